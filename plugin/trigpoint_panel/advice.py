"""What the engine advises for its command line, said as the panel does it."""

from __future__ import annotations

# Of errors and cautions about a CRS, all of which may end in naming the option that assigns one.
ABOUT_CRS = frozenset({"crs", "crs_missing", "crs_conflict", "crs_doubtful", "region"})
HERE = "in the menu, under CRS of the reference"


def advised(code: str, message: str) -> str:
    """Return the message of an error or caution, with its advice fit to be followed here.

    Examples
    --------
    >>> advised("crs_missing", "the header names no CRS: name it with --crs.")
    'the header names no CRS: name it in the menu, under CRS of the reference.'
    """
    return message.replace("with --crs", HERE) if code in ABOUT_CRS else message

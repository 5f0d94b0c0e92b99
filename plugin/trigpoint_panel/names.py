"""Names in sentences: one that is written from right to left turns itself, and not the sentence."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable

_FROM_RIGHT = frozenset({"R", "AL", "AN", "RLE", "RLO", "RLI"})
# The mark before it settles the sentence's own direction, also where the name begins it.
_BEGIN = "\N{LEFT-TO-RIGHT MARK}\N{FIRST STRONG ISOLATE}"
_END = "\N{POP DIRECTIONAL ISOLATE}"


def isolated(name: str) -> str:
    r"""Return a name as it stands in a sentence from left to right.

    Examples
    --------
    >>> isolated("P4")
    'P4'
    >>> ascii(isolated("\N{HEBREW LETTER ALEF}"))
    "'\\u200e\\u2068\\u05d0\\u2069'"
    """
    if any(unicodedata.bidirectional(letter) in _FROM_RIGHT for letter in name):
        return f"{_BEGIN}{name}{_END}"
    return name


def listed(names: Iterable[str]) -> str:
    """Return names one after the other, each as it stands in a sentence.

    Examples
    --------
    >>> listed(["P4", "P2"])
    'P4, P2'
    """
    return ", ".join(isolated(name) for name in names)

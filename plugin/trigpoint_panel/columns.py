"""The columns of the pair table: how their heads read and what their cells hold."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Column:
    """One column: where its cells come from and how its head reads.

    Attributes
    ----------
    key : str
        Of the pair, or of the fit's table.
    head : str
        Its second line is the unit.
    about : str
        The whole story, for the tool tip.
    widest : str
        What it must have room for.
    digits : int or None
        Decimals shown; None for words.
    edited : bool
    """

    key: str
    head: str
    about: str
    widest: str
    digits: int | None = None
    edited: bool = False


SOURCE = "In the source's own frame. Emptied, it is picked anew."
TARGET = "in the reference's CRS. Emptied, it is picked anew."
COLUMNS = (
    Column(
        "role",
        "Use\n",
        "Control pairs make the fit; check pairs only test it. Space changes.",
        "XX control",
        edited=True,
    ),
    Column(
        "id", "Pair\n", "Its name. Double-click: both views fly there.", "course2-nw", edited=True
    ),
    Column("flag", "Verdict\n", "What is wrong with the pair, in a word.", "not testable"),
    # What a pair is worth stands beside its name; what it was made of can be scrolled to.
    Column("d_m", "3D\nm", "Length of the residual; the bar compares the pairs.", "00.000XX", 3),
    Column(
        "loo_m",
        "LOO\nm",
        "Leave-one-out: the residual's length in a fit to the other pairs.",
        "00.000",
        3,
    ),
    Column("dx_m", "dE\nm", "Residual: reference minus transformed source.", "-00.000", 3),
    Column("dy_m", "dN\nm", "Residual: reference minus transformed source.", "-00.000", 3),
    Column("dz_m", "dH\nm", "Residual: reference minus transformed source.", "-00.000", 3),
    Column("source_x", "Source X\nunits", SOURCE, "-00.000", 3, True),
    Column("source_y", "Y\nunits", SOURCE, "-00.000", 3, True),
    Column("source_z", "Z\nunits", SOURCE, "-00.000", 3, True),
    Column("target_x", "Reference E\nm", f"Easting {TARGET}", "000000.000", 3, True),
    Column("target_y", "N\nm", f"Northing {TARGET}", "0000000.000", 3, True),
    Column("target_z", "H\nm", f"Height {TARGET}", "0000.000", 3, True),
    Column(
        "redundancy",
        "Redun-\ndancy",
        "How far other pairs check this one: 0 not, 3 fully.",
        "Redun-",
        2,
    ),
    Column(
        "detectable_blunder_m",
        "Detect-\nable m",
        "The smallest blunder that would be found.",
        "able m0",
        2,
    ),
    Column("p_value", "p\n", "Chance of a residual as large if nothing were wrong.", "<0.0010", 3),
    Column(
        "sigma_source",
        "Source sigma\nunits",
        "Sigma of the pick in the source, per axis.",
        "Source sigma",
        4,
        True,
    ),
    Column(
        "sigma_target",
        "Ref. sigma\nm",
        "Sigma of the pick in the reference, per axis.",
        "Ref. sigma",
        3,
        True,
    ),
    Column(
        "note",
        "Note\n",
        "What was pointed at, and how it was snapped.",
        "lower string course, top",
        edited=True,
    ),
)
AT = {column.key: i for i, column in enumerate(COLUMNS)}

"""What each statistic means, with its formula."""

# ruff: noqa: RUF001 - formulas are printed with their own signs, which look like letters

from __future__ import annotations

from trigpoint_reporting.blocks import Block, Table
from trigpoint_reporting.evidence import Evidence

TERMS = (
    ("Residual", "reference − transformed pick", "At a pick that the fit used; small by design."),
    ("RMSE", "√(Σ|e|²/n)", "Root mean square of 3D errors; no degrees of freedom taken off."),
    (
        "RMSE by degrees of freedom",
        "√(Σ|e|²/(n − 7/3))",
        "Allows for the seven fitted parameters: 3n − 7 redundant equations, three to a point.",
    ),
    (
        "Leave-one-out RMSE",
        "√(Σ|e₍ᵢ₎|²/n)",
        "Each pick predicted by a fit to the others. Internal validation, not a test.",
    ),
    (
        "Scale sensitivity",
        "100 max|sᵢ − s|/s",
        "Largest change of scale when one pick is left out.",
    ),
    (
        "Check pick",
        "\N{EN DASH}",
        "A pick that enters nothing: fit, consensus, leave-one-out, ICP.",
    ),
    (
        "σ per axis",
        "√(Σ|e|²/(3n − 7))",
        "Noise of one pick along one axis, as the residuals show it.",
    ),
    ("95 % interval of σ", "χ² with 3n − 7", "Where the noise may lie, errors being normal."),
    ("Redundancy", "tr(I − H)ᵢ", "0 to 3: how much of a pick's own error shows in its residual."),
    ("Standardised residual", "√(eᵀ Q⁻¹ e)", "A residual in its own standard deviations."),
    (
        "Detectable blunder",
        "α = 0.001, power 0.80",
        "The smallest error of a pick that would show.",
    ),
    ("Accuracy", "reconstruction → reference", "How far what is there lies from the reference."),
    ("Completeness", "reference → reconstruction", "How much of the reference is there."),
    (
        "NMAD",
        "1.4826 × median|d − median|",
        "Like a standard deviation, and blind to a few outliers.",
    ),
    ("P95", "95th percentile", "Nineteen of twenty distances are no larger."),
    (
        "Floor",
        "half against half",
        "What the reference scores against itself: its spacing and noise.",
    ),
    (
        "Plot scale",
        "error / 0.18 mm",
        "Largest scale at which the error stays within a drawn line.",
    ),
)


def glossary(evidence: Evidence) -> list[Block]:  # noqa: ARG001 - a section like the others
    """Return the glossary."""
    return [Table("Statistics in this report", ("Term", "Formula", "Meaning"), TERMS)]

"""What stands under the pair table: the errors that sum it up, and the layout's verdict."""

from __future__ import annotations

import math

from qtpy.QtWidgets import QHBoxLayout, QLabel, QWidget

from trigpoint_panel.forms import say
from trigpoint_panel.model import Model

# Each error stays in one piece where the numbers take two lines.
WHOLE = str.maketrans(" -", "\N{NO-BREAK SPACE}\N{NON-BREAKING HYPHEN}")


class Totals(QWidget):
    """What stands under the table: the three errors that sum it up, and the layout's verdict."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 3, 8, 3)
        row.setSpacing(14)
        self.numbers, self.layout_verdict = QLabel(self), QLabel(self)
        self.numbers.setWordWrap(True)  # in a narrow dock they take two lines
        row.addWidget(self.numbers, 1)
        row.addWidget(self.layout_verdict)

    def refresh(self, model: Model) -> None:
        """Take over what the model holds now."""
        fit = model.fit
        icp = fit.adopted is not None
        parts: tuple[str, ...] = (
            f"RMSE {'after ICP: ' if icp else ''}control {_metres(fit.rmse_m)}",
            f"check {_metres(fit.check_rmse_m)}" if fit.checks else "no check pairs",
            f"leave-one-out {_metres(fit.loocv_rmse_m)}{' (before ICP)' if icp else ''}",
        )
        if fit.alignment is None:
            parts = ("No fit yet: no RMSE.",)
        self.numbers.setText("   ".join(part.translate(WHOLE) for part in parts))
        words = {"sound": "Layout: sound", "weak": "Layout: weak", "refused": "Layout: refused"}
        levels = {"sound": "success", "weak": "warning", "refused": "error"}
        word, level = words.get(fit.geometry, ""), levels.get(fit.geometry, "")
        if fit.geometry == "sound" and fit.doubt:  # of what was picked, not of where
            word = f"{word}, a pick {'suspect' if fit.flagged('suspect') else 'rejected'}"
            level = "warning"
        say(self.layout_verdict, word, level)
        self.layout_verdict.setToolTip(" ".join((fit.statement, fit.doubt)).strip())


def _metres(value: float) -> str:
    return "n/a" if math.isnan(value) else f"{value:.3f} m"

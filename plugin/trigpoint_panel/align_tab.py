"""The Align tab: how the pairs are fitted, what came out, and ICP as an experiment."""

from __future__ import annotations

import math
from typing import cast

import numpy as np
from qtpy.QtCore import Signal
from qtpy.QtWidgets import QApplication, QCheckBox, QComboBox, QSpinBox, QWidget
from scipy.spatial.transform import Rotation

from trigpoint.consensus import Method
from trigpoint.similarity import Similarity
from trigpoint.trial import MOST_FOLDS, Trial
from trigpoint_panel.forms import NumberBox, Tab, quietly, say
from trigpoint_panel.model import Model
from trigpoint_panel.pairs import Place
from trigpoint_panel.statistics import Fit

METHODS: dict[Method, str] = {
    "ransac": "RANSAC, drawn sets of 3",
    "exhaustive": "Every set of 3",
    "all": "All pairs, no consensus",
}


class AlignTab(Tab):
    """Settings of the fit, the similarity, where to pick next, and ICP on trial.

    Attributes
    ----------
    icp_wanted : Signal()
    save_wanted : Signal()
        The aligned cloud is to be saved.
    place_wanted : Signal(object)
        A place in the target to be shown.
    """

    icp_wanted = Signal()
    save_wanted = Signal()
    place_wanted = Signal(object)

    def __init__(self, model: Model, parent: QWidget | None = None) -> None:
        super().__init__("align", parent)
        self._model = model
        self._trial: Trial | None = None
        self._of: object = None
        self._places: list[Place] = []

        self.heading("Similarity")
        self.summary = self.sentence()
        self.geometry_verdict = self.sentence()
        (self.copy, self.save) = self.buttons(
            ("Copy matrix", self._copy), ("Save aligned cloud…", self.save_wanted.emit)
        )

        self.heading("Where to pick next")
        self.next = self.sentence(faint=True)
        (self.show_next,) = self.buttons(("Show the best place", self._show_next))

        self.heading("ICP, as an experiment")
        self.rule = self.sentence(
            "Rigid ICP runs on a copy. Held-out picks say whether it helped; the pairs that were "
            "fitted cannot. Adopted, it is in the views and in the saved cloud; the report "
            "delivers the fit without it.",
            faint=True,
        )
        (self.try_icp,) = self.buttons(("Try ICP", self.icp_wanted.emit))
        self.verdict = self.sentence()
        self.errors = self.sentence()
        self.adopt, self.discard = self.buttons(("Adopt", self._adopt), ("Discard", self._discard))

        self.heading("How the pairs are fitted")
        form = self.form()
        self.method = QComboBox(self.inside)
        self.method.setAccessibleName("Method")
        for key, text in METHODS.items():
            self.method.addItem(text, key)
        self.method.setSizeAdjustPolicy(
            QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon
        )
        self.method.setMinimumContentsLength(12)
        form.addRow("Method", self.method)
        self.threshold = NumberBox(self.inside)
        self.threshold.setRange(0.001, 1000)
        self.threshold.setDecimals(3)
        self.threshold.setSingleStep(0.05)
        self.threshold.setSuffix(" m")
        self.threshold.setToolTip("A control pair counts where its residual is at most this.")
        form.addRow("Threshold", self.threshold)
        self.trials = QSpinBox(self.inside)
        self.trials.setRange(1, 10_000_000)
        self.trials.setSingleStep(1000)
        self.trials.setGroupSeparatorShown(True)
        form.addRow("Draws", self.trials)
        self.seed = QSpinBox(self.inside)
        self.seed.setRange(0, 2_147_483_647)
        form.addRow("Seed", self.seed)
        self.weighted = QCheckBox("Weight by the picks' sigmas", self.inside)
        form.addRow(self.weighted)
        for field in (self.threshold, self.trials, self.seed):
            field.setKeyboardTracking(False)
        self.method.currentIndexChanged.connect(self._set_method)
        self.threshold.valueChanged.connect(
            lambda v: self.change(model.set_alignment, threshold_m=float(v))
        )
        self.trials.valueChanged.connect(lambda v: self.change(model.set_alignment, trials=int(v)))
        self.seed.valueChanged.connect(lambda v: self.change(model.set_alignment, seed=int(v)))
        self.weighted.toggled.connect(
            lambda on: self.change(model.set_alignment, weighted=bool(on))
        )
        self.column.addStretch(1)
        self.refresh(can_run=False)

    def refresh(self, *, can_run: bool) -> None:
        """Take over what the model holds now; `can_run`: clouds are there, nothing runs."""
        model, fit = self._model, self._model.fit
        settings = model.state.alignment
        with quietly(self.method, self.threshold, self.trials, self.seed, self.weighted):
            self.method.setCurrentIndex(self.method.findData(settings.method))
            self.threshold.setValue(settings.threshold_m)
            self.trials.setValue(settings.trials)
            self.seed.setValue(settings.seed)
            self.weighted.setChecked(settings.weighted)
        self.trials.setEnabled(settings.method == "ransac")
        self.seed.setEnabled(settings.method == "ransac")
        self.threshold.setEnabled(settings.method != "all")

        shown = model.similarity
        say(self.summary, fit.refusal if shown is None else _told(shown, model))
        geometry = {"sound": "success", "weak": "warning", "refused": "error", "": ""}[fit.geometry]
        statement = " ".join((fit.statement, fit.doubt)).strip()
        if fit.adopted is not None:
            statement = f"Of the fit, before ICP: {statement}"
        if fit.doubt and geometry == "success":
            geometry = "warning"  # the layout is sound, a pick is not
        say(self.geometry_verdict, statement if shown is not None else "", geometry)
        self.copy.setEnabled(shown is not None)
        self.save.setEnabled(shown is not None and model.state.source_path is not None)
        rows = fit.next_picks.itertuples(index=False)
        self._places = []
        lines = []
        for k, row in enumerate(rows, start=1):
            x, y, z, gain = (float(v) for v in row)
            self._places.append((x, y, z))
            lines.append(f"{k}.  E {x:.1f}  N {y:.1f}  H {z:.1f}   −{100 * gain:.1f} cm")  # noqa: RUF001
        if lines:
            lines.append(
                "In metres; the last number is by how much the largest sigma would shrink. The "
                "report judges more places; its best lie near these."
            )
        say(self.next, "\n".join(lines) or _why_nowhere(fit))
        self.show_next.setEnabled(bool(lines))

        if self._trial is not None and self._of is not fit.alignment:
            self._trial = None  # it judged a fit that is no more
        self.try_icp.setEnabled(can_run and fit.alignment is not None)
        self._show_trial()

    def set_trial(self, trial: Trial, of: object) -> None:
        """Show what ICP did to the fit `of`."""
        self._trial, self._of = trial, of
        self._show_trial()

    def _show_trial(self) -> None:
        trial, adopted = self._trial, self._model.state.adopted
        self.adopt.setEnabled(trial is not None and adopted is None)
        self.discard.setEnabled(trial is not None or adopted is not None)
        if trial is None:
            say(self.verdict, "ICP is adopted for what is shown and saved." if adopted else "")
            say(self.errors, "")
            return
        text, level = _judged(trial, self._model, "adopted" if adopted else "not adopted")
        say(self.verdict, text, level)
        lines = [
            f"Moves the reference's centre by {trial.refinement.shift_m:.3f} m, turns by "
            f"{trial.refinement.rotation_deg:.3f}°.",
            "Surfaces, RMSE: "
            + _change(
                trial.refinement.surface_rmse_before_m, trial.refinement.surface_rmse_after_m
            ),
        ]
        if trial.control_rmse_before_m is not None and trial.control_rmse_after_m is not None:
            lines.append(
                "Control pairs: "
                + _change(trial.control_rmse_before_m, trial.control_rmse_after_m)
                + "; decides nothing."
            )
        say(self.errors, "\n".join(lines))

    def _set_method(self) -> None:
        self.change(self._model.set_alignment, method=cast(Method, self.method.currentData()))

    def _copy(self) -> None:
        if self._model.similarity is not None:
            rows = self._model.similarity.matrix.tolist()
            text = "\n".join(" ".join(repr(value) for value in row) for row in rows)
            QApplication.clipboard().setText(text + "\n")

    def _adopt(self) -> None:
        alignment = self._model.fit.alignment
        if self._trial is not None and alignment is not None:
            self._model.adopt(self._trial.refinement.similarity @ alignment.similarity)

    def _discard(self) -> None:
        self._trial = None
        if self._model.state.adopted is not None:
            self._model.discard_adopted()
        self._show_trial()

    def _show_next(self) -> None:
        if self._places:
            self.place_wanted.emit(self._places[0])


def _told(shown: Similarity, model: Model) -> str:
    turn = Rotation.from_matrix(shown.rotation).as_rotvec()
    angle = float(np.linalg.norm(turn))
    axis = turn / angle if angle else np.array([0.0, 0.0, 1.0])
    east, north, height = shown.translation.tolist()
    alignment = model.fit.alignment
    lines = ["The fit, followed by ICP:"] if model.fit.adopted is not None else []
    lines += [
        f"scale  {shown.scale:.6f} m per unit",
        f"rotation  {np.degrees(angle):.4f}° about ({axis[0]:.3f}, {axis[1]:.3f}, {axis[2]:.3f})",
        f"translation  {east:.3f}, {north:.3f}, {height:.3f}\N{NO-BREAK SPACE}m",
    ]
    if alignment is not None and alignment.loocv.max_scale_change_pct is not None:
        change = alignment.loocv.max_scale_change_pct
        lines.append(f"the fit's scale changes by up to {change:.2f} % when a pair is left out")
    return "\n".join(lines)


def _change(before: float, after: float) -> str:
    """Write two lengths with as many digits as it takes to tell them apart."""
    digits = next((n for n in (3, 4, 5) if f"{before:.{n}f}" != f"{after:.{n}f}"), 6)
    return f"{before:.{digits}f} m → {after:.{digits}f} m"


def _judged(trial: Trial, model: Model, so: str) -> tuple[str, str]:
    """Say what ICP did to the held-out error, as far as so few picks can show it, and the level.

    An RMSE of n picks in three axes is itself known to about 1 / sqrt(6 n) of its value.
    """
    fit = model.fit
    before, after = trial.check_rmse_before_m, trial.check_rmse_after_m
    count, of = fit.checks, f"Error at the {_counted(fit.checks, 'check pair')}"
    if before is None:
        before, after = trial.loocv_rmse_before_m, trial.loocv_rmse_after_m
        count = min(int(fit.table["used"].sum()), MOST_FOLDS)
        of = f"Leave-one-out error of {_counted(count, 'pair')}"
    if before is None or not count:
        why = "too few pairs are left when one is withheld"
        return f"Not judged, {so}: {why}.", "warning"
    if after is None:
        why = "with a pair withheld the clouds no longer overlap enough"
        return f"Not judged, {so}: {why}.", "warning"
    known = before / math.sqrt(6 * count)
    change = f"{of}: {_change(before, after)}, {_signed(after - before)}"
    if abs(after - before) < known:
        few = f"less than {_counted(count, 'pair')} can show (±{known:.3f} m)"
        return f"Undecided, {so}. {change}: {few}.", ""
    word, level = ("Better", "success") if after < before else ("Worse", "warning")
    return f"{word}, {so}. {change}; it is known to ±{known:.3f} m.", level


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def _signed(change: float) -> str:
    """Write a change in metres with its sign, and with a digit that is not zero."""
    digits = next((n for n in (3, 4, 5) if f"{abs(change):.{n}f}" != f"{0:.{n}f}"), 6)
    return f"{'−' if change < 0 else '+'}{abs(change):.{digits}f} m"  # noqa: RUF001


def _why_nowhere(fit: Fit) -> str:
    if fit.geometry == "refused":
        return f"Not known without a fit. {fit.refusal}"
    if fit.alignment is None:
        return "Known from three control pairs on, once the reference is open."
    return "Known once the reference is open."

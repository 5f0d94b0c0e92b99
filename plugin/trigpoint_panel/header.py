"""The bar above a view: what is shown, and how."""

from __future__ import annotations

from typing import Any

from qtpy import QtCore, QtGui, QtWidgets

from trigpoint.crsparts import crs_code
from trigpoint_panel.camera import Face, Position
from trigpoint_panel.colouring import LABELS, ColourMode
from trigpoint_panel.elided import ElidedLabel
from trigpoint_panel.opening import Opened

UPS: dict[str, Position] = {
    "+X": (1.0, 0.0, 0.0),
    "+Y": (0.0, 1.0, 0.0),
    "+Z": (0.0, 0.0, 1.0),
    "-X": (-1.0, 0.0, 0.0),
    "-Y": (0.0, -1.0, 0.0),
    "-Z": (0.0, 0.0, -1.0),
}
FACES: dict[str, Face] = {
    "Front": "front",
    "Right": "right",
    "Back": "back",
    "Left": "left",
    "Top": "top",
}


class Header(QtWidgets.QWidget):
    """Says which cloud is shown, and lets its look be chosen."""

    mode_chosen = QtCore.Signal(str)
    size_chosen = QtCore.Signal(float)
    eye_dome_chosen = QtCore.Signal(bool)
    fit_chosen = QtCore.Signal()
    face_chosen = QtCore.Signal(str)
    parallel_chosen = QtCore.Signal(bool)
    up_chosen = QtCore.Signal(object)

    def __init__(self, title: str, parent: QtWidgets.QWidget | None = None) -> None:
        super().__init__(parent)
        self._title = title
        self._is_empty = True
        self.label = ElidedLabel(self, parted=True)
        self.colour = QtWidgets.QComboBox()
        self.colour.setToolTip("Colour by")
        self.colour.setAccessibleName(f"Colour the {title.lower()} by")
        self.colour.setSizeAdjustPolicy(QtWidgets.QComboBox.SizeAdjustPolicy.AdjustToContents)
        self.size_slider = QtWidgets.QSlider(QtCore.Qt.Orientation.Horizontal)
        self.size_slider.setRange(1, 10)
        self.size_slider.setFixedWidth(56)
        self.size_slider.setToolTip("Point size (+ and -)")
        self.size_slider.setAccessibleName(f"Point size of the {title.lower()}")
        self.eye_dome = self._button("EDL", "Eye-dome lighting: darken edges in depth (E)")
        self.eye_dome.setCheckable(True)
        self.eye_dome.setChecked(True)
        self.fit = self._button("Fit", "Look at the whole cloud (F)")
        self.more = self._button("⋯", "Fit, directions, projection and what is up")
        self.more.setPopupMode(QtWidgets.QToolButton.ToolButtonPopupMode.InstantPopup)
        self.more.setStyleSheet("QToolButton::menu-indicator { image: none; width: 0; }")
        self.parallel, menu = self._menu()
        self.more.setMenu(menu)
        # As high when it is empty, or the view would jump when a cloud comes.
        self.setMinimumHeight(self.colour.sizeHint().height() + 4)
        row = QtWidgets.QHBoxLayout(self)
        row.setContentsMargins(6, 2, 2, 2)
        row.setSpacing(4)
        row.addWidget(self.label, 1)
        for widget in (self.colour, self.size_slider, self.eye_dome, self.fit, self.more):
            row.addWidget(widget)
        self.colour.activated.connect(self._choose_mode)
        self.size_slider.valueChanged.connect(lambda value: self.size_chosen.emit(float(value)))
        self.eye_dome.toggled.connect(self.eye_dome_chosen)
        self.fit.clicked.connect(lambda: self.fit_chosen.emit())
        self.describe(None)
        self.offer((), None)

    def describe(self, opened: Opened | None) -> None:
        """Say which cloud is shown, how much of it, and its units."""
        if opened is None:
            self.label.setText(self._title)
            self.label.setToolTip("")
            return
        shown, total = len(opened.cloud), opened.total
        crs = opened.info.crs
        code = None if crs is None else crs_code(crs)
        units = "in units of its own" if crs is None else f"in metres, {crs.name}"
        short = "own units" if crs is None else f"{code.split('+')[0]}, m" if code else "m"
        count = f"{_short(shown)} of {_short(total)}" if opened.is_thinned else _short(total)
        self.label.setText(f"{self._title}: {opened.path.name}, {short}, {count} points")
        self.label.setToolTip(
            f"{opened.path}\n{shown:,} of {total:,} points shown\n"
            f"{f'{units} ({code})' if code else units}\n{opened.info.format}"
        )

    def offer(self, modes: tuple[ColourMode, ...], mode: ColourMode | None) -> None:
        """Offer what the cloud can be coloured by."""
        self.colour.clear()
        for each in modes:
            self.colour.addItem(LABELS[each], each)
        if mode is not None:
            self.colour.setCurrentIndex(self.colour.findData(mode))
        self._is_empty = not modes
        self._arrange()

    def set_states(self, *, size: float, eye_dome: bool, parallel: bool) -> None:
        """Show settings that were changed elsewhere."""
        for widget in (self.size_slider, self.eye_dome, self.parallel):
            widget.blockSignals(True)
        self.size_slider.setValue(round(size))
        self.eye_dome.setChecked(eye_dome)
        self.parallel.setChecked(parallel)
        for widget in (self.size_slider, self.eye_dome, self.parallel):
            widget.blockSignals(False)

    def resizeEvent(self, event: QtGui.QResizeEvent) -> None:
        """Leave the name room before the tools that have keys."""
        super().resizeEvent(event)
        self._arrange()

    def _arrange(self) -> None:
        for widget, room in (
            (self.colour, 0),
            (self.more, 0),
            (self.fit, 300),
            (self.eye_dome, 350),
            (self.size_slider, 430),
        ):
            widget.setVisible(not self._is_empty and self.width() >= room)

    def _choose_mode(self, row: int) -> None:
        self.mode_chosen.emit(self.colour.itemData(row))

    def _button(self, text: str, tip: str) -> QtWidgets.QToolButton:
        button = QtWidgets.QToolButton()
        button.setText(text)
        button.setToolTip(tip)
        button.setAccessibleName(f"{tip}: {self._title.lower()}")
        button.setAutoRaise(True)
        return button

    def _menu(self) -> tuple[Any, QtWidgets.QMenu]:
        menu = QtWidgets.QMenu(self)
        menu.addAction("Fit").triggered.connect(lambda: self.fit_chosen.emit())
        menu.addSeparator()
        for text, face in FACES.items():
            menu.addAction(text).triggered.connect(
                lambda _checked=False, face=face: self.face_chosen.emit(face)
            )
        menu.addSeparator()
        parallel = menu.addAction("Parallel projection")
        parallel.setCheckable(True)
        parallel.toggled.connect(self.parallel_chosen)
        ups = menu.addMenu("Up is")
        for text, up in UPS.items():
            ups.addAction(text).triggered.connect(
                lambda _checked=False, up=up: self.up_chosen.emit(up)
            )
        ups.addAction("Guessed from the ground").triggered.connect(
            lambda: self.up_chosen.emit(None)
        )
        return parallel, menu


def _short(count: int) -> str:
    """Write a number of points in three digits.

    Examples
    --------
    >>> _short(950), _short(497_916), _short(30_000_000)
    ('950', '498 k', '30.0 M')
    """
    if count < 1000:
        return str(count)
    return f"{count / 1e6:.1f} M" if count >= 999_500 else f"{count / 1000:.0f} k"

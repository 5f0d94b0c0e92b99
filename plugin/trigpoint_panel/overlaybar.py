"""Bar under a view: how much of the overlaid source is seen, and which of both clouds."""

from __future__ import annotations

from qtpy import QtCore, QtWidgets

STATES = {"A+B": "both", "A": "reference", "B": "source"}


class OverlayBar(QtWidgets.QWidget):
    """A slider for the opacity of the overlay, and a button that swaps the clouds.

    Signals
    -------
    opacity_chosen (float)
        From 0 to 1.
    swap_chosen ()
    """

    opacity_chosen = QtCore.Signal(float)
    swap_chosen = QtCore.Signal()

    def __init__(self, parent: QtWidgets.QWidget | None = None) -> None:
        super().__init__(parent)
        self._opacity = QtWidgets.QSlider(QtCore.Qt.Orientation.Horizontal)
        self._opacity.setRange(0, 100)
        self._opacity.setValue(100)
        self._opacity.setAccessibleName("Opacity of the overlaid source")
        self._opacity.setToolTip("How much of the overlaid source is seen")
        self._opacity.valueChanged.connect(lambda value: self.opacity_chosen.emit(value / 100))
        swap = QtWidgets.QToolButton()
        swap.setText("Swap")
        swap.setToolTip("Reference alone, source alone, both (X)")
        swap.clicked.connect(lambda: self.swap_chosen.emit())
        self._state = QtWidgets.QLabel(STATES["A+B"])
        self._state.setToolTip("What is shown")
        # As wide as the longest, or the slider would jump.
        widest = max(map(self._state.fontMetrics().horizontalAdvance, STATES.values()))
        self._state.setMinimumWidth(widest)
        row = QtWidgets.QHBoxLayout(self)
        row.setContentsMargins(6, 2, 6, 2)
        row.addWidget(QtWidgets.QLabel("Overlay"))
        row.addWidget(self._opacity, 1)
        row.addWidget(self._state)
        row.addWidget(swap)
        self.hide()

    def set_opacity(self, opacity: float) -> None:
        """Show another opacity; emits nothing."""
        self._opacity.blockSignals(True)
        self._opacity.setValue(round(100 * opacity))
        self._opacity.blockSignals(False)

    def set_state(self, state: str) -> None:
        """Say what is shown: A, B, or A+B."""
        self._state.setText(STATES[state])

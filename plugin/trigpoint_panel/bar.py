"""The toolbar: the switches and buttons in reach, and the menu of the rest."""

from __future__ import annotations

from typing import cast

from qtpy.QtCore import Qt, Signal
from qtpy.QtGui import QAction
from qtpy.QtWidgets import (
    QComboBox,
    QDoubleSpinBox,
    QLabel,
    QMenu,
    QSizePolicy,
    QToolBar,
    QToolButton,
    QWidget,
)

from trigpoint_panel.actions import COMMANDS
from trigpoint_panel.icons import icon
from trigpoint_panel.snapping import Mode
from trigpoint_panel.style import Look

SNAPS: dict[Mode, str] = {
    "point": "Point",
    "centroid": "Centroid",
    "highest": "Highest",
    "corner": "Corner of 3 planes",
}
# Between the groups stand lines.
MENU = (
    ("open_session", "save", "save_as", "write_project"),
    ("import_picks", "import_source", "import_target", "export_picks"),
    ("save_aligned", "choose_crs"),
    ("new_pair", "next_pair", "previous_pair", "ghost", "delete", "role"),
    ("second", "view"),
    ("compare", "icp", "report"),
    ("demo", "help"),
)
SUBMENUS = {
    "second": (
        "Second operator",
        ("second_begin", "second_adopt", "second_keep", "second_cancel"),
    ),
    "view": (
        "View",
        ("fit_view", "front", "right", "top", "parallel", "eye_dome", "larger", "smaller"),
    ),
}


class Bar(QToolBar):
    """The toolbar.

    Attributes
    ----------
    snap_changed : Signal(str, object)
        What clicks snap to, and how far around, in metres; None: as near as one can point.
    """

    snap_changed = Signal(str, object)

    def __init__(self, actions: dict[str, QAction], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._actions = actions
        self.setObjectName("bar")
        self.setMovable(False)
        self.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        for name in ("open_source", "open_target"):
            self.addAction(actions[name])
        self.addSeparator()
        self.addAction(actions["pick"])
        self.addWidget(_label("Snap", self))
        self.snap = QComboBox(self)
        self.snap.setAccessibleName("Snap to")
        self.snap.setToolTip("What a click snaps to; the click itself is kept in the pair's note.")
        for mode, text in SNAPS.items():
            self.snap.addItem(text, mode)
        self.addWidget(self.snap)
        self.radius = QDoubleSpinBox(self)
        self.radius.setAccessibleName("Snap radius")
        self.radius.setToolTip("How far around the click snapping looks; auto: a few pixels.")
        self.radius.setRange(0, 100)
        self.radius.setSpecialValueText("auto")
        self.radius.setSingleStep(0.1)
        self.radius.setSuffix(" m")
        self.radius.setValue(0)
        self.radius.setEnabled(False)
        self.addWidget(self.radius)
        self.addSeparator()
        for name in ("undo", "redo"):
            self.addAction(actions[name])
        self.addSeparator()
        for name in ("link", "overlay", "swap"):
            self.addAction(actions[name])
        self.addSeparator()
        self.addAction(actions["next_places"])
        space = QWidget(self)
        space.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self.addWidget(space)
        self.addAction(actions["pane"])
        self.menu_button = QToolButton(self)
        self.menu_button.setText("Menu")
        self.menu_button.setToolTip("Everything else (F10)")
        self.menu_button.setShortcut("F10")
        self.menu_button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.menu_button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.menu = QMenu(self.menu_button)
        self._fill(self.menu)
        self.menu_button.setMenu(self.menu)
        self.addWidget(self.menu_button)
        self.widgetForAction(actions["pick"]).setObjectName("pick-button")
        for button in self.findChildren(QToolButton):
            button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.snap.currentIndexChanged.connect(self._snap)
        self.radius.valueChanged.connect(self._snap)

    def restyle(self, look: Look) -> None:
        """Draw the icons in the theme's colours."""
        for name, command in COMMANDS.items():
            if command.icon:
                down = look.on_accent if name == "pick" else look.accent
                self._actions[name].setIcon(icon(command.icon, look.text, down))
        self.menu_button.setIcon(icon("menu", look.text, look.text))

    def _fill(self, menu: QMenu) -> None:
        for group in MENU:
            menu.addSeparator()
            for name in group:
                if name in SUBMENUS:
                    title, names = SUBMENUS[name]
                    menu.addMenu(title).addActions([self._actions[each] for each in names])
                else:
                    menu.addAction(self._actions[name])

    def _snap(self) -> None:
        mode = cast(Mode, self.snap.currentData())
        self.radius.setEnabled(mode != "point")
        self.snap_changed.emit(mode, self.radius.value() or None)


def _label(text: str, parent: QWidget) -> QLabel:
    label = QLabel(f" {text} ", parent)
    label.setProperty("role", "faint")
    return label

"""The toolbar: the switches and buttons in reach, and the menu of the rest."""

from __future__ import annotations

from typing import cast

from qtpy.QtCore import Qt, Signal
from qtpy.QtGui import QAction, QResizeEvent
from qtpy.QtWidgets import (
    QComboBox,
    QLabel,
    QMenu,
    QSizePolicy,
    QToolBar,
    QToolButton,
    QWidget,
)

from trigpoint_panel.actions import COMMANDS
from trigpoint_panel.forms import NumberBox
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
        (
            "fit_view",
            "front",
            "right",
            "top",
            "parallel",
            "eye_dome",
            "magnify",
            "larger",
            "smaller",
        ),
    ),
}
# Which buttons keep their words, from the widest bar to the narrowest; all have an icon.
WORDED: tuple[frozenset[str], ...] = (
    frozenset(
        {"menu", "open_source", "open_target", "pick", "link", "overlay", "swap"}
        | {"next_places", "pane"}
    ),
    frozenset({"menu", "open_source", "open_target", "pick", "pane"}),
    frozenset({"open_source", "open_target", "pick"}),
    frozenset({"open_source", "open_target"}),
    frozenset(),
)


class Bar(QToolBar):
    """The toolbar.

    The menu stands first, where no bar is too narrow for it. The buttons say as much in words as
    there is room for; what has no room even as an icon is in the menu behind the bar's last arrow.

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
        self.menu_button = QToolButton(self)
        self.menu_button.setText("Menu")
        self.menu_button.setAccessibleName("Menu")
        self.menu_button.setToolTip("Everything else (F10)")
        self.menu_button.setShortcut("F10")
        self.menu_button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.menu = QMenu(self.menu_button)
        self._fill(self.menu)
        self.menu_button.setMenu(self.menu)
        self.addWidget(self.menu_button)
        self.addSeparator()
        for name in ("open_source", "open_target"):
            self.addAction(actions[name])
        self.addSeparator()
        self.addAction(actions["pick"])
        self._snap_label = self.addWidget(_label("Snap", self))
        self.snap = QComboBox(self)
        self.snap.setAccessibleName("Snap to")
        self.snap.setToolTip("What a click snaps to; the click itself is kept in the pair's note.")
        for mode, text in SNAPS.items():
            self.snap.addItem(text, mode)
        self.addWidget(self.snap)
        self.radius = NumberBox(self)
        self.radius.setAccessibleName("Snap radius")
        self.radius.setToolTip("How far around the click snapping looks; auto: a few pixels.")
        self.radius.setRange(0, 100)
        self.radius.setSpecialValueText("auto")
        self.radius.setSingleStep(0.1)
        self.radius.setSuffix(" m")
        self.radius.setValue(0)
        self._radius = self.addWidget(self.radius)
        self._radius.setEnabled(False)
        self.addSeparator()
        for name in ("undo", "redo"):
            self.addAction(actions[name])
        self.addSeparator()
        for name in ("link", "overlay", "swap"):
            self.addAction(actions[name])
        self.addSeparator()
        for name in ("next_places", "magnify"):
            self.addAction(actions[name])
        space = QWidget(self)
        space.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self.addWidget(space)
        self.addAction(actions["pane"])
        self.widgetForAction(actions["pick"]).setObjectName("pick-button")
        for button in self.findChildren(QToolButton):
            button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self._buttons: dict[str, QToolButton] = {"menu": self.menu_button}
        for name, action in actions.items():
            made = self.widgetForAction(action)
            if isinstance(made, QToolButton):
                self._buttons[name] = made
        arrow = self.findChild(QToolButton, "qt_toolbar_ext_button")
        assert arrow is not None
        self._arrow = arrow
        self.snap.currentIndexChanged.connect(self._snap)
        self.radius.valueChanged.connect(self._snap)

    def restyle(self, look: Look) -> None:
        """Draw the icons in the theme's colours."""
        for name, command in COMMANDS.items():
            if command.icon:
                down = look.on_accent if name == "pick" else look.accent
                self._actions[name].setIcon(icon(command.icon, look.text, down))
        self.menu_button.setIcon(icon("menu", look.text, look.text))
        self._arrow.setIcon(icon("more", look.text, look.text))
        self._word()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Say in words what there is room for."""
        super().resizeEvent(event)
        if event.oldSize().width() != event.size().width():
            self._word()

    def _word(self) -> None:
        for worded in WORDED:
            for name, button in self._buttons.items():
                button.setToolButtonStyle(
                    Qt.ToolButtonStyle.ToolButtonTextBesideIcon
                    if name in worded
                    else Qt.ToolButtonStyle.ToolButtonIconOnly
                )
            # Where not even icons fit, the label gives way too, and a radius that serves nothing.
            self._snap_label.setVisible(bool(worded))
            self._radius.setVisible(bool(worded) or self.snap.currentData() != "point")
            inside = self.layout()
            assert inside is not None
            inside.invalidate()
            if self.sizeHint().width() <= self.width():
                return

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
        self._radius.setEnabled(mode != "point")
        self._word()
        self.snap_changed.emit(mode, self.radius.value() or None)


def _label(text: str, parent: QWidget) -> QLabel:
    label = QLabel(f" {text} ", parent)
    label.setProperty("role", "faint")
    return label

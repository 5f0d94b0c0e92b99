"""Everything the panel can be told to do, with its keys: one table, and when each can be done."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from qtpy.QtCore import Qt
from qtpy.QtGui import QAction, QKeySequence
from qtpy.QtWidgets import QWidget

from trigpoint_panel import stateline
from trigpoint_panel.model import Model


class Command(NamedTuple):
    """One thing to do.

    Attributes
    ----------
    text : str
        Of its button.
    keys : str
        Between blanks; empty: none.
    about : str
        For its tool tip and the list of keys.
    icon : str
        Of `trigpoint_panel.icons`; empty: none.
    checked : bool or None
        Whether it is down at first; None: it is no switch.
    needs : str
        What of the state line must be enabled; empty: it always is.
    """

    text: str
    keys: str
    about: str
    icon: str = ""
    checked: bool | None = None
    needs: stateline.Action | str = ""


COMMANDS: dict[str, Command] = {
    "open_source": Command(
        "Source", "Ctrl+O", "Open the source: the reconstruction", "source", needs="open"
    ),
    "open_target": Command(
        "Reference", "Ctrl+R", "Open the reference: the LiDAR", "reference", needs="open"
    ),
    "pick": Command(
        "Pick", "P", "Pick by clicking; drags still turn the view", "pick", False, "pick"
    ),
    "undo": Command("Undo", "Ctrl+Z", "Undo", "undo"),
    "redo": Command("Redo", "Ctrl+Shift+Z Ctrl+Y", "Redo", "redo"),
    "link": Command("Link", "L", "Tie both cameras through the fit", "link", False, "link"),
    "overlay": Command(
        "Overlay",
        "O",
        "Show the fitted source in the reference's view",
        "overlay",
        False,
        "overlay",
    ),
    "swap": Command(
        "Swap", "X", "Show one cloud, then the other, in place", "swap", None, "overlay"
    ),
    "next_places": Command("Next", "", "Mark where to pick next", "next", True, "link"),
    "magnify": Command(
        "Magnify (or hold Z)",
        "",
        "Show four times as large what the mouse points at, in both views; or hold Z",
        "magnify",
        False,
    ),
    "pane": Command("Tabs", "F9", "Show or hide Align, Errors and Report", "pane", True),
    "escape": Command("Stop", "Esc", "Cancel the job, else drop the open half, else stop picking"),
    "delete": Command("Delete pairs", "Del", "Delete the selected pairs"),
    "role": Command("Control, check, off", "", "Space: change the role of the selected pairs"),
    "to_control": Command("Use as control", "", "They make the fit"),
    "to_check": Command("Use as check", "", "They only test the fit"),
    "to_off": Command("Use not at all", "", "They are kept, and count for nothing"),
    "fly": Command("Fly to the pair", "", "Double click: both views fly to the selected pair"),
    "new_pair": Command("Type a pair", "Ins", "Begin a pair and type its coordinates"),
    "next_pair": Command("Next pair", "N", "Select the next pair; both views fly there"),
    "previous_pair": Command("Previous pair", "Shift+N", "Select the pair before"),
    "ghost": Command("Go to the ghost", "G", "Fly to where the open half should be"),
    "eye_dome": Command("Eye-dome lighting", "E", "Turn eye-dome lighting on or off", "", True),
    "fit_view": Command("Fit view", "F", "See the whole of both clouds"),
    "front": Command("Front", "1", "Look from the front"),
    "right": Command("Right", "3", "Look from the right"),
    "top": Command("Top", "7", "Look from the top"),
    "parallel": Command("Parallel", "5", "Perspective or parallel", "", False),
    "larger": Command("Larger points", "+ =", "Draw larger points"),
    "smaller": Command("Smaller points", "-", "Draw smaller points"),
    "open_session": Command(
        "Open session or project…",
        "Ctrl+Shift+O",
        "Open a .trig.json or a project.toml",
        needs="open",
    ),
    "save": Command("Save session", "Ctrl+S", "Save the session"),
    "save_as": Command("Save session as…", "Ctrl+Shift+S", "Save the session elsewhere"),
    "write_project": Command("Write project.toml…", "", "For trigpoint audit, with its picks.csv"),
    "choose_crs": Command("CRS of the reference…", "", "Assign a CRS; nothing is reprojected"),
    "import_picks": Command("Import picks…", "", "Pairs of a picks.csv"),
    "import_source": Command("Import source points…", "", "CloudCompare's list of one side"),
    "import_target": Command("Import reference points…", "", "CloudCompare's list of one side"),
    "export_picks": Command("Export picks…", "", "For trigpoint, QGIS or CloudCompare"),
    "save_aligned": Command(
        "Save aligned cloud…", "", "Carry the source into the reference's frame", needs="export"
    ),
    "second_begin": Command("Begin", "", "Hide the picks; a second operator picks them again"),
    "second_adopt": Command("Finish, take the sigma found", "", "For pairs that state none"),
    "second_keep": Command("Finish, change no sigma", "", "Only say how far the picks lie apart"),
    "second_cancel": Command("Give up", "", "Bring the first picks back"),
    "compare": Command("Compare", "", "Measure accuracy and completeness", needs="errors"),
    "icp": Command("Try ICP", "", "Put rigid ICP on trial", needs="errors"),
    "report": Command("Make the report", "Ctrl+E", "Run the audit", needs="report"),
    "demo": Command("Open the clock tower", "", "A made-up project with known truth", needs="open"),
    "help": Command("Keys and mouse", "F1", "What the keys and the mouse do"),
}
Told = tuple[str, str]
# What the help says, in groups: the name of a command, or keys that are no command's.
HELP: dict[str, tuple[str | Told, ...]] = {
    "Files": ("open_source", "open_target", "open_session", "save", "save_as", "report"),
    "Pairs": (
        "pick",
        "escape",
        "undo",
        "redo",
        "new_pair",
        "delete",
        ("Space", "Control, check or off, for the selected pairs"),
        ("Empty a coordinate", "Open that half again, to pick it anew"),
        "next_pair",
        "previous_pair",
        "ghost",
    ),
    "Views": (
        "link",
        "overlay",
        "swap",
        "fit_view",
        "front",
        "right",
        "top",
        "parallel",
        "eye_dome",
        "larger",
        "smaller",
    ),
    "Mouse in a view": (
        ("Drag", "Turn"),
        ("Right or middle drag", "Move; so does Shift with a drag"),
        ("Ctrl and drag", "Roll"),
        ("Wheel", "Zoom to the mouse"),
        ("Double click", "Fly there, while not picking; on a row of the table, fly to its pair"),
        ("Z, held", "Magnify at the mouse, in both views"),
    ),
    "Window": (("F10", "Menu of everything else"), "pane", "help"),
}


def make_actions(panel: QWidget) -> dict[str, QAction]:
    """Make the actions of a panel; their keys work while the focus is somewhere in it."""
    made = {}
    for name, command in COMMANDS.items():
        action = QAction(command.text, panel)
        action.setObjectName(name)
        action.setShortcuts([QKeySequence(keys) for keys in command.keys.split()])
        # A host such as QGIS keeps its own keys.
        action.setShortcutContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
        first = command.keys.split()[:1]
        action.setToolTip(f"{command.about} ({first[0]})" if first else command.about)
        if command.checked is not None:
            action.setCheckable(True)
            action.setChecked(command.checked)
            action.setIconVisibleInMenu(False)  # it would stand in place of the tick
        panel.addAction(action)
        made[name] = action
    return made


def enable(
    actions: Mapping[str, QAction], line: stateline.StateLine, model: Model, *, running: bool
) -> None:
    """Enable what can be done where things stand so, and name what undo and redo would do."""
    for name, command in COMMANDS.items():
        if command.needs:
            actions[name].setEnabled(command.needs in line.enabled)
    undo, redo = actions["undo"], actions["redo"]
    for action, word, text in (
        (undo, "Undo", model.undo_text),
        (redo, "Redo", model.redo_text),
    ):
        action.setEnabled(bool(text) and not running)
        said = f"{word} {text[:1].lower()}{text[1:]}" if text else word
        action.setToolTip(f"{said} ({action.shortcut().toString()})")
        action.setStatusTip(said)
    second = model.state.is_second_operator
    actions["second_begin"].setEnabled(bool(model.pairs) and not second)
    for name in ("second_adopt", "second_keep", "second_cancel"):
        actions[name].setEnabled(second)
    actions["export_picks"].setEnabled(bool(model.pairs))
    for name in ("link", "overlay"):
        action = actions[name]
        # While a second operator picks there is no fit either, and afterwards there is again.
        if action.isChecked() and model.similarity is None and not second:
            action.setChecked(False)  # there is nothing to tie or to carry it by
    actions["swap"].setEnabled(actions["overlay"].isChecked())


def keys_told() -> dict[str, list[Told]]:
    """Return every key and what it does, in groups."""
    return {
        group: [each if isinstance(each, tuple) else _told(COMMANDS[each]) for each in members]
        for group, members in HELP.items()
    }


def _told(command: Command) -> Told:
    return " or ".join(command.keys.split()), command.about

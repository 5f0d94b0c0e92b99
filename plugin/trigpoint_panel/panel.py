"""The panel: two views, the pair table, three tabs, a toolbar and a foot, round one model."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from qtpy.QtCore import QEvent, Qt, QTimer, Signal
from qtpy.QtGui import QDragEnterEvent, QDropEvent, QKeyEvent, QResizeEvent
from qtpy.QtWidgets import QAbstractSpinBox, QLineEdit, QPlainTextEdit, QWidget

from trigpoint.errors import TrigpointError
from trigpoint_panel.actions import COMMANDS, enable, make_actions
from trigpoint_panel.align_tab import AlignTab
from trigpoint_panel.arrangement import arrange, is_narrow, stacked, tabbed
from trigpoint_panel.bar import Bar
from trigpoint_panel.canvas import CanvasKind
from trigpoint_panel.desk import Desk
from trigpoint_panel.errors_tab import ErrorsTab
from trigpoint_panel.folders import demo_folder, scratch_folder
from trigpoint_panel.foot import Foot
from trigpoint_panel.forms import with_points
from trigpoint_panel.hands import Hands
from trigpoint_panel.help import KeysWindow
from trigpoint_panel.host import Host
from trigpoint_panel.jobs import Job, told
from trigpoint_panel.model import Model
from trigpoint_panel.operators import begin_second_operator, cancel_second_operator
from trigpoint_panel.pairs import SIDES, Side
from trigpoint_panel.report_tab import ReportTab
from trigpoint_panel.runs import Runs
from trigpoint_panel.session import Session
from trigpoint_panel.stateline import StateLine, state_line
from trigpoint_panel.style import look_of, sheet, theme_of
from trigpoint_panel.table import PairTable
from trigpoint_panel.totals import Totals
from trigpoint_panel.views import TwoViews

AUTOSAVE_MS = 400
OPACITY = 0.6  # of the overlay, at first
# In the menu of a row of the table.
OF_A_ROW = ("fly", "to_control", "to_check", "to_off", "delete")
SIZES = (1.0, 2.0, 3.0, 4.0, 6.0, 8.0)  # of points, in pixels


class Panel(QWidget):
    """The whole thing: picks, fit, comparison and report, in whatever window holds it.

    Parameters
    ----------
    host : Host
        Who shows the panel: its settings, messages, files and threads.
    model : Model, optional
        By default an empty one.
    parent : QWidget, optional
    canvas : {"auto", "gl", "image"}
        What the views are drawn on.
    scratch : Path, optional
        Where changes that have no file yet are autosaved.

    Attributes
    ----------
    title_changed : Signal(str)
        What to write over the window; an asterisk where something is not saved.
    """

    title_changed = Signal(str)

    def __init__(
        self,
        host: Host,
        model: Model | None = None,
        parent: QWidget | None = None,
        *,
        canvas: CanvasKind = "auto",
        scratch: Path | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("trigpoint-panel")
        self.setLocale(with_points())
        self.host = host
        self.model = model or Model()
        self.session = Session(self.model, scratch=scratch or scratch_folder())
        self.failure = ""
        self._theme = ""
        self._closed = False
        self._is_narrow = self._tabs_wait = False
        self._keys: KeysWindow | None = None
        self.actions_by_name = make_actions(self)

        self.bar = Bar(self.actions_by_name, self)
        self.views = TwoViews(self.model, self, canvas=canvas)
        self.table = PairTable(self.model, self)
        self.totals = Totals(self)
        self.align_tab = AlignTab(self.model, self)
        self.errors_tab = ErrorsTab(self.model, self)
        self.report_tab = ReportTab(self.model, self)
        self.foot = Foot(host.run, self)
        self.hands = Hands(host, self.model, self.views, self.table)
        self.desk = Desk(host, self.model, self.session, self.views, self.foot)
        tabs = (self.align_tab, self.errors_tab, self.report_tab)
        self.tabs = tabbed(self, dict(zip(("Align", "Errors", "Report"), tabs, strict=True)))
        front = self.tabs.setCurrentWidget
        self.runs = Runs(host, self.model, self.desk, self.views, self.foot, tabs, front)
        self.upright = stacked(self, self.views, self.table, self.totals)
        self.across = arrange(self, self.bar, self.upright, self.tabs, self.foot)

        self._autosave = QTimer(self)
        self._autosave.setSingleShot(True)
        self._autosave.setInterval(AUTOSAVE_MS)
        self._autosave.timeout.connect(self.desk.autosave)
        self._connect()
        # A theme arrives palette by palette: once they have all come is soon enough.
        self._restyle = QTimer(self)
        self._restyle.setSingleShot(True)
        self._restyle.timeout.connect(self.restyle)
        self.model.changed.append(self._model_changed)
        self.setAcceptDrops(True)
        self.restyle()
        self.refresh()

    # What can be done --------------------------------------------------------------------------

    @property
    def line(self) -> StateLine:
        """Where things stand."""
        return state_line(self.model, running=self.foot.running, failure=self.failure)

    def action(self, name: str) -> Any:
        """Return one of the actions of `trigpoint_panel.actions`."""
        return self.actions_by_name[name]

    def open_cloud(self, side: Side, path: Path | str) -> Job:
        """Open a cloud on one side."""
        return self.desk.open_cloud(side, Path(path).absolute())

    def open_session(self, path: Path | str) -> Job:
        """Open a session or a project.toml."""
        return self.desk.open_session(Path(path).absolute())

    def open_demo(self, folder: Path | None = None) -> Job:
        """Make the clock tower, unless it is there, and open it."""
        return self.runs.open_demo(folder or demo_folder())

    def compare(self) -> Job | None:
        """Measure accuracy and completeness of the source as the views show it."""
        return self.runs.compare()

    def try_icp(self) -> Job | None:
        """Put ICP on trial on the fit."""
        return self.runs.try_icp()

    def make_report(self) -> Job | None:
        """Write the project, and run the audit on it in a process of its own."""
        return self.runs.make_report()

    def cancel(self) -> bool:
        """Give up on what runs; tell whether anything did."""
        return self.foot.cancel()

    def shutdown(self) -> None:
        """Stop everything and free what the views hold; may be called again."""
        if self._closed:
            return
        self._closed = True
        self._autosave.stop()
        self.session.leave()
        self.foot.cancel()
        self.model.changed.remove(self._model_changed)
        if self._keys is not None:
            self._keys.close()
        self.views.shutdown()

    def refresh(self) -> None:
        """Show what the model holds now."""
        self.table.refresh()
        self.totals.refresh(self.model)
        self.views.refresh()
        self._show_state()
        self.title_changed.emit(self.title)

    @property
    def title(self) -> str:
        """The session's name, with an asterisk where something is not saved."""
        return f"{self.session.name}{' *' if self.session.is_modified else ''}"

    def restyle(self) -> None:
        """Take over the colours of the theme that the panel is shown in."""
        theme = theme_of(self)
        if theme != self._theme:
            self._theme = theme
            self.setStyleSheet(sheet(look_of(self)))
            self.bar.restyle(look_of(self))

    # How it is put together --------------------------------------------------------------------

    def _connect(self) -> None:
        model, desk, views, hands = self.model, self.desk, self.views, self.hands
        does: dict[str, Callable[[], object]] = {
            "open_source": partial(desk.ask_cloud, "source"),
            "open_target": partial(desk.ask_cloud, "target"),
            "undo": model.undo,
            "redo": model.redo,
            "swap": views.target.swap,
            "escape": self._escape,
            "delete": lambda: model.delete(self.table.chosen()),
            "role": hands.cycle_role,
            "to_control": partial(hands.set_role, "control"),
            "to_check": partial(hands.set_role, "check"),
            "to_off": partial(hands.set_role, "off"),
            "fly": hands.fly_to_chosen,
            "new_pair": hands.type_pair,
            "next_pair": partial(hands.walk, 1),
            "previous_pair": partial(hands.walk, -1),
            "ghost": hands.fly_to_ghost,
            "fit_view": views.fit,
            "front": partial(views.look, "front"),
            "right": partial(views.look, "right"),
            "top": partial(views.look, "top"),
            "larger": partial(self._resize_points, 1),
            "smaller": partial(self._resize_points, -1),
            "open_session": desk.ask_session,
            "save": desk.save,
            "save_as": partial(desk.save, elsewhere=True),
            "write_project": desk.ask_project,
            "choose_crs": desk.choose_crs,
            "import_picks": desk.ask_picks,
            "import_source": partial(desk.ask_points, "source"),
            "import_target": partial(desk.ask_points, "target"),
            "export_picks": desk.ask_export,
            "save_aligned": desk.save_aligned,
            "second_begin": partial(begin_second_operator, model),
            "second_adopt": partial(hands.end_second, adopt=True),
            "second_keep": partial(hands.end_second, adopt=False),
            "second_cancel": partial(cancel_second_operator, model),
            "compare": self.compare,
            "icp": self.try_icp,
            "report": self.make_report,
            "demo": self.open_demo,
            "help": self._show_keys,
        }
        switches: dict[str, Callable[[bool], object]] = {
            "pick": views.set_picking,
            "link": views.set_linked,
            "overlay": views.set_overlaid,
            "next_places": views.show_next,
            "magnify": views.magnify,
            "pane": lambda _: self._share_room(),
            "eye_dome": self._set_eye_dome,
            "parallel": views.set_parallel,
        }
        for name, act in does.items():
            self.actions_by_name[name].triggered.connect(partial(self._do, name, act))
        for name, switch in switches.items():
            self.actions_by_name[name].toggled.connect(switch)
        assert {*does, *switches} == set(COMMANDS)
        for side in SIDES:
            view = views.view(side)
            view.picked.connect(partial(hands.take, side))
            view.refused.connect(partial(self.host.message, "info"))
            view.dropped.connect(lambda path, side=side: desk.open_dropped(Path(path), side))
        views.hovered.connect(self.foot.where.setText)
        views.clouds_changed.connect(self.runs.drop_findings)
        self.bar.snap_changed.connect(views.set_snap)
        views.target.set_overlay_opacity(OPACITY)
        for name in OF_A_ROW:
            self.table.addAction(self.actions_by_name[name])
        self.table.flown.connect(hands.fly)
        self.table.refused.connect(partial(self.host.message, "error"))
        self.table.role_wanted.connect(hands.cycle_role)
        self.align_tab.icp_wanted.connect(self.try_icp)
        self.align_tab.save_wanted.connect(desk.save_aligned)
        self.align_tab.place_wanted.connect(views.fly_to_target)
        self.errors_tab.compare_wanted.connect(self.compare)
        self.errors_tab.zone_chosen.connect(self.runs.isolate)
        self.report_tab.report_wanted.connect(self.make_report)
        self.report_tab.document_wanted.connect(self.host.open_document)
        for tab in (self.align_tab, self.errors_tab, self.report_tab):
            tab.refused.connect(partial(self.host.message, "error"))
        self.action("overlay").toggled.connect(lambda _: self._show_state())
        self.runs.failed.connect(self._failed)
        self.foot.changed.connect(self._show_state)
        self.foot.went_on.connect(lambda: self.foot.show_line(self.line))

    # What happens ------------------------------------------------------------------------------

    def _model_changed(self) -> None:
        self.failure = ""
        self.refresh()
        self._autosave.start()

    def _show_state(self) -> None:
        """Show the state line, and enable what goes with it."""
        line = self.line
        self.foot.show_line(line)
        running = self.foot.running is not None
        enable(self.actions_by_name, line, self.model, running=running)
        both = all(each is not None for each in self.views.opened.values())
        self.align_tab.refresh(can_run="errors" in line.enabled and both)
        self.errors_tab.refresh(can_run="errors" in line.enabled and both)
        self.report_tab.refresh(can_run="report" in line.enabled)

    def _do(self, name: str, act: Callable[[], object], *_: object) -> None:
        try:
            act()
        except (TrigpointError, OSError) as error:
            self.host.message("error", f"{COMMANDS[name].text.rstrip('…')}: {told(error)}")

    def _failed(self, text: str) -> None:
        self.failure = text
        self._show_state()

    def _resize_points(self, step: int) -> None:
        size = float(self.host.setting("view/point_size", 2.0))
        at = min(range(len(SIZES)), key=lambda i: abs(SIZES[i] - size))
        size = SIZES[min(max(at + step, 0), len(SIZES) - 1)]
        self.host.set_setting("view/point_size", size)
        for side in SIDES:
            self.views.view(side).set_point_size(size)

    def _set_eye_dome(self, on: bool) -> None:
        for side in SIDES:
            self.views.view(side).set_eye_dome(on)

    def _share_room(self) -> None:
        """Show the views and the tabs beside each other, or where that is too narrow one of them.

        The views come first: the tabs wait until there is room again, or are called.
        """
        pane, narrow = self.action("pane"), is_narrow(self.across)
        if narrow != self._is_narrow:
            self._is_narrow = narrow
            if narrow:
                self._tabs_wait = pane.isChecked()
            pane.setChecked(not narrow and (self._tabs_wait or pane.isChecked()))
        self.tabs.setVisible(pane.isChecked())
        self.upright.setVisible(not (narrow and pane.isChecked()))

    def _escape(self) -> None:
        if self.cancel() or self.model.drop_open_half() is not None:
            return
        self.action("pick").setChecked(False)

    def _show_keys(self) -> None:
        if self._keys is None:
            self._keys = KeysWindow(self)
        self._keys.show()
        self._keys.raise_()

    # What Qt asks ------------------------------------------------------------------------------

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Share the room out anew."""
        super().resizeEvent(event)
        self._share_room()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Take the keys that are held or that buttons need too: Z and Space."""
        if event.key() == Qt.Key.Key_Z and not event.modifiers():
            if not event.isAutoRepeat():
                self.views.magnify(True)
            event.accept()
        elif event.key() == Qt.Key.Key_Space and not _is_typing(self.focusWidget()):
            self.hands.cycle_role()
            event.accept()
        else:
            super().keyPressEvent(event)

    def keyReleaseEvent(self, event: QKeyEvent) -> None:
        """Let the magnifier go, unless its switch is on."""
        if event.key() == Qt.Key.Key_Z and not event.isAutoRepeat():
            self.views.magnify(self.action("magnify").isChecked())
            event.accept()
        else:
            super().keyReleaseEvent(event)

    def changeEvent(self, event: QEvent) -> None:
        """Follow the theme, and let Z go when another window comes to the front."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_restyle"):
            self._restyle.start()
        elif event.type() == QEvent.Type.ActivationChange and not self._closed:
            self.views.magnify(self.action("magnify").isChecked())

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Take files."""
        if event.mimeData().hasUrls():
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Open the files that were dropped."""
        for url in event.mimeData().urls():
            if url.isLocalFile():
                self.desk.open_dropped(Path(url.toLocalFile()))
        event.acceptProposedAction()


def _is_typing(widget: QWidget | None) -> bool:
    return isinstance(widget, QLineEdit | QPlainTextEdit | QAbstractSpinBox)

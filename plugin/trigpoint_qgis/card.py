"""The card in the dock where packages are missing: what, why, how big, and three ways out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from qgis.core import QgsApplication, QgsSettings, QgsTask
from qgis.PyQt.QtCore import QCoreApplication, Qt, pyqtSignal
from qgis.PyQt.QtGui import QFontDatabase
from qgis.PyQt.QtWidgets import (
    QFileDialog,
    QFrame,
    QGridLayout,
    QLabel,
    QPlainTextEdit,
    QPushButton,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

from trigpoint_qgis import child, deps, installer


class DependencyCard(QScrollArea):
    """Says what is missing and offers to install it, to use a folder, or to copy the commands.

    Parameters
    ----------
    lacks : tuple of Lack
    changed : callable
        Called when there is a reason to look again.
    fault : str
        Why the folder that was chosen can't be used; empty if none was, or it can.
    """

    def __init__(
        self,
        lacks: tuple[deps.Lack, ...],
        changed: Callable[[], object],
        fault: str = "",
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("TrigpointDependencyCard")
        self.setWidgetResizable(True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self._changed = changed
        self._lacks = lacks
        self._task: InstallTask | None = None
        inside = QWidget(self)
        self.setWidget(inside)
        column = QVBoxLayout(inside)
        column.setContentsMargins(24, 20, 24, 20)
        column.setSpacing(12)

        missing = self._tr("Some Python packages are missing")
        title = QLabel(missing if lacks else self._tr("The panel can't be shown"), inside)
        font = title.font()
        font.setPointSizeF(font.pointSizeF() * 1.4)
        font.setBold(True)
        title.setFont(font)
        column.addWidget(title)
        self.text = self._paragraph(self._explained(lacks) if lacks else "", column)
        self.fault = self._paragraph(fault, column)
        news = self.fault.font()
        news.setBold(True)
        self.fault.setFont(news)
        self.fault.setVisible(bool(fault))

        self.install = self._button(self._tr("Install…"), self.start)
        self.choose = self._button(self._tr("Choose folder…"), self.choose_folder)
        self.copy = self._button(self._tr("Copy commands"), self.copy_commands)
        self.cancel = self._button(self._tr("Cancel"), self.stop)
        into = self._tr("Makes an environment in your profile, {folder}. Takes some minutes.")
        self._ways = QGridLayout()
        self._ways.setHorizontalSpacing(12)
        self._ways.setColumnStretch(1, 1)
        for button, about in (
            (self.install, into.format(folder=self._folder())),
            (
                self.choose,
                self._tr("Uses an environment, or a folder of packages, that you have already."),
            ),
            (self.copy, self._tr("For a terminal: the two commands that Install… would run.")),
            (self.cancel, self._tr("Removes what was made so far.")),
        ):
            self._add_way(button, about)
        column.addLayout(self._ways)
        self._offer(self.cancel, yes=False)
        self._offer(self.install, yes=bool(lacks))

        self.log = QPlainTextEdit(inside)
        self.log.setReadOnly(True)
        self.log.setMaximumBlockCount(5000)
        self.log.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        self.log.hide()
        column.addWidget(self.log, 1)
        column.addStretch(0)

    @property
    def waits(self) -> bool:
        """Whether packages are missing and nothing is being installed here."""
        return bool(self._lacks) and self._task is None

    def start(self) -> None:
        """Install the packages; the log shows how far it is."""
        self.log.clear()
        self.log.show()
        self._running(True)
        self._say(self._tr("Installing: this takes a few minutes."))
        task = InstallTask(self._folder())
        task.said.connect(self.log.appendPlainText)
        task.ended.connect(self._ended)
        self._task = task
        QgsApplication.taskManager().addTask(task)

    def stop(self) -> None:
        """Give up on the installation; what it has made so far is removed."""
        if self._task is not None:
            self._task.cancel()

    def choose_folder(self) -> None:
        """Let the user name the folder that has the packages."""
        folder = QFileDialog.getExistingDirectory(self, self._tr("Folder of Python packages"))
        if folder:
            self.use(folder)

    def use(self, folder: str) -> None:
        """Use a folder from now on, or say why it can't be used."""
        try:
            deps.find_environment(Path(folder))
        except deps.FolderError as fault:
            self._say(str(fault))
            return
        QgsSettings().setValue("trigpoint/python_env", folder)
        self._changed()

    def copy_commands(self) -> None:
        """Put the commands on the clipboard."""
        try:
            python: Path | str = child.base_python()
        except FileNotFoundError:
            python = "python3"
        every = installer.commands(self._folder(), python, deps.REQUIREMENTS)
        QgsApplication.clipboard().setText(installer.as_text(every))
        self._say(self._tr("Copied. When they have run, close this panel and open it again."))

    def shutdown(self) -> None:
        """End an installation that runs."""
        task, self._task = self._task, None
        if task is not None:
            task.ended.disconnect(self._ended)
            task.cancel()
            task.waitForFinished(5000)

    def _ended(self, fault: str) -> None:
        self._task = None
        self._running(False)
        if fault:
            self._say(fault)
            return
        # The one in the profile is what was just made, whatever was chosen before.
        QgsSettings().setValue("trigpoint/python_env", "")
        self._say(self._tr("Ready."))
        self._changed()

    def _running(self, yes: bool) -> None:
        for button in (self.install, self.choose, self.copy):
            button.setEnabled(not yes)
        self._offer(self.cancel, yes=yes)

    def _say(self, text: str) -> None:
        self.fault.setText(text)
        self.fault.show()

    def _explained(self, lacks: tuple[deps.Lack, ...]) -> str:
        return self._tr(
            "The panel shows point clouds with VTK and reads them with packages that QGIS does not "
            "bring.\n\n{named}\n\nWith what reports need they take {size}. They go into a folder "
            "of their own and come after QGIS's own packages, never before: no other plugin "
            "notices. QGIS need not be restarted."
        ).format(named=deps.listed(lacks), size=deps.SIZE)

    def _add_way(self, button: QPushButton, about: str) -> None:
        row = self._ways.rowCount()
        label = QLabel(about, self.widget())
        label.setWordWrap(True)
        label.setBuddy(button)
        self._ways.addWidget(button, row, 0)
        self._ways.addWidget(label, row, 1)

    def _offer(self, button: QPushButton, *, yes: bool) -> None:
        """Show a way out with what is said of it, or neither."""
        row = self._ways.getItemPosition(self._ways.indexOf(button))[0]
        for side in (0, 1):
            self._ways.itemAtPosition(row, side).widget().setVisible(yes)

    def _paragraph(self, text: str, column: QVBoxLayout) -> QLabel:
        label = QLabel(text, self.widget())
        label.setWordWrap(True)
        label.setTextFormat(Qt.TextFormat.PlainText)
        label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        column.addWidget(label)
        return label

    def _button(self, title: str, pressed: Callable[[], object]) -> QPushButton:
        button = QPushButton(title, self.widget())
        button.clicked.connect(lambda _checked=False: pressed())
        return button

    def _folder(self) -> Path:
        return Path(QgsApplication.qgisSettingsDirPath()) / deps.OWN

    def _tr(self, text: str) -> str:
        return QCoreApplication.translate("Trigpoint", text)


class InstallTask(QgsTask):
    """The installation, as a task of QGIS: each line of its log, and how it ended."""

    said = pyqtSignal(str)
    # Why it failed in a sentence; empty where it did not.
    ended = pyqtSignal(str)

    def __init__(self, folder: Path, requirements: Path = deps.REQUIREMENTS) -> None:
        super().__init__("Trigpoint: installing packages", QgsTask.Flag.CanCancel)
        self._folder, self._requirements = folder, requirements

    def run(self) -> bool:
        """Install, in a thread of QGIS's."""
        fault = ""
        try:
            installer.install(
                self._folder, self._requirements, on_line=self.said.emit, poll=self._poll
            )
        except _CancelledError:
            fault = "Cancelled: nothing was installed."
        except installer.InstallError as error:
            fault = str(error)
        except Exception as error:  # whatever it is, the card must hear of the end
            fault = f"The packages could not be installed: {error}"
        self.ended.emit(fault)
        return not fault

    def _poll(self) -> None:
        if self.isCanceled():
            raise _CancelledError


class _CancelledError(Exception):
    """The user cancelled."""

"""What the four algorithms share: what they need, how they speak, and how they fail."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from qgis.core import (
    QgsProcessing,
    QgsProcessingAlgorithm,
    QgsProcessingContext,
    QgsProcessingException,
    QgsProcessingLayerPostProcessorInterface,
    QgsProcessingParameterDefinition,
    QgsProcessingParameterNumber,
)
from qgis.PyQt.QtCore import QCoreApplication
from qgis.PyQt.QtGui import QIcon

from trigpoint_qgis import deps, layers

ICON = Path(__file__).parents[1] / "icon.svg"
DOUBLE = QgsProcessingParameterNumber.Type.Double
INTEGER = QgsProcessingParameterNumber.Type.Integer
ADVANCED = QgsProcessingParameterDefinition.Flag.FlagAdvanced
TYPES = QgsProcessing.SourceType


class StoppedError(Exception):
    """The user cancelled."""


class TrigpointAlgorithm(QgsProcessingAlgorithm):
    """An algorithm that calls trigpoint; a kind of it says what it reads and makes."""

    NAME = ""
    TITLE = ""
    HELP = ""

    def __init__(self) -> None:
        super().__init__()
        # What this run puts on the map: the kinds of layers and their ids.
        self.pile: list[tuple[str, str]] = []

    def name(self) -> str:
        """Return the name after the provider's prefix."""
        return self.NAME

    def displayName(self) -> str:
        """Return the name in the toolbox."""
        return self.tr(self.TITLE)

    def shortHelpString(self) -> str:
        """Return the help beside the parameters."""
        return self.tr(self.HELP)

    def icon(self) -> QIcon:
        """Return the icon in the toolbox."""
        return QIcon(str(ICON))

    def createInstance(self) -> TrigpointAlgorithm:
        """Return a fresh one, for one run."""
        return type(self)()

    def tr(self, text: str) -> str:
        """Translate."""
        return QCoreApplication.translate("Trigpoint", text)

    def canExecute(self) -> tuple[bool, str]:
        """Say whether the packages are there, and which are not."""
        message = deps.explain(deps.lacking(deps.ENGINE))
        return not message, message

    def processAlgorithm(
        self, parameters: dict[str, Any], context: QgsProcessingContext, feedback: Any
    ) -> dict[str, Any]:
        """Run; what trigpoint refuses is told in its own sentence."""
        possible, reason = self.canExecute()
        if not possible:
            raise QgsProcessingException(reason)
        deps.load()
        with told():
            try:
                return self.work(parameters, context, feedback)
            except StoppedError:
                return {}

    def work(
        self, parameters: dict[str, Any], context: QgsProcessingContext, feedback: Any
    ) -> dict[str, Any]:
        """Do the work and return the outputs: plain numbers and strings."""
        raise NotImplementedError

    def number(self, name: str, title: str, kind: Any, default: Any, **limits: Any) -> None:
        """Add a number to the advanced parameters."""
        given = QgsProcessingParameterNumber(name, self.tr(title), kind, default, **limits)
        given.setFlags(given.flags() | ADVANCED)
        self.addParameter(given)

    def numbers_of(self, text: str, name: str) -> tuple[float, ...]:
        """Read a list of numbers separated by commas."""
        try:
            return tuple(float(part) for part in text.replace(";", ",").split(",") if part.strip())
        except ValueError:
            message = f"{name} is {text!r}; it must be numbers separated by commas."
            raise QgsProcessingException(message) from None

    def loaded(
        self, layer_id: str, name: str, kind: str, context: QgsProcessingContext, **more: Any
    ) -> None:
        """Name and style a layer, where Processing is to add it to the map."""
        if context.willLoadLayerOnCompletion(layer_id):
            details = context.layerToLoadOnCompletionDetails(layer_id)
            details.name = name
            details.setPostProcessor(Styler(kind, more, self.pile))


class Styler(QgsProcessingLayerPostProcessorInterface):
    """Styles one layer once it is in the map, and puts it where it is seen.

    Parameters
    ----------
    kind : str
    more : dict of str to object
        For `layers.style`.
    pile : list of tuple
        The kinds and ids of the same run's layers; this one joins them.
    seen : bool
        Whether it is switched on: of a pile of rasters only the uppermost would be seen.
    """

    def __init__(
        self,
        kind: str,
        more: dict[str, Any],
        pile: list[tuple[str, str]],
        *,
        seen: bool = True,
    ) -> None:
        super().__init__()
        self.kind, self.more, self.pile, self.seen = kind, more, pile, seen
        _waiting.append(self)

    def postProcessLayer(self, layer: Any, context: Any, _feedback: Any) -> None:
        """Style it."""
        _waiting.remove(self)
        layers.style(layer, self.kind, **self.more)
        self.pile.append((self.kind, layer.id()))
        if context.project() is None:
            return
        root = context.project().layerTreeRoot()
        node = root.findLayer(layer.id())
        if node is not None and not self.seen:
            node.setItemVisibilityChecked(False)
            node.setExpanded(False)
        arrange(root, self.pile)


# Nobody else holds them: Processing runs a copy of an algorithm, and styles what it made after the
# copy is gone.
_waiting: list[Styler] = []


def arrange(root: Any, pile: list[tuple[str, str]]) -> None:
    """Put picks over vectors, those over a footprint, and that over rasters; in each group.

    Processing's own order depends on names, on its version and on the layer that is selected.
    """
    groups: dict[int, tuple[Any, list[Any]]] = {}
    for _, layer_id in sorted(pile, key=lambda one: layers.PILE.index(one[0]), reverse=True):
        node = root.findLayer(layer_id)
        if node is not None:
            groups.setdefault(id(node.parent()), (node.parent(), []))[1].append(node)
    for group, nodes in groups.values():
        if nodes == [each for each in group.children() if each in nodes]:
            continue
        top = min(group.children().index(node) for node in nodes)
        for place, node in enumerate(nodes, top):
            group.insertChildNode(place, node.clone())
        for node in nodes:
            group.removeChildNode(node)


@contextmanager
def told() -> Iterator[None]:
    """Turn what is refused or can't be read into the sentence that Processing shows."""
    from trigpoint.errors import TrigpointError

    try:
        yield
    except (TrigpointError, ValueError) as error:
        raise QgsProcessingException(_advised(str(error))) from error
    except OSError as error:
        why = error.strerror or str(error)
        message = f"{error.filename} can't be read or written: {why}." if error.filename else why
        raise QgsProcessingException(message) from error


def sayer(feedback: Any) -> Callable[[str], None]:
    """Return what tells Processing of each step, and stops between two where the user cancels."""

    def say(step: str) -> None:
        if feedback.isCanceled():
            raise StoppedError
        feedback.setProgressText(step)

    return say


def warn(feedback: Any, cautions: Any) -> None:
    """Tell of doubts."""
    for caution in cautions:
        feedback.pushWarning(_advised(caution.message))


def _advised(message: str) -> str:
    # The engine names its command line's option; here it is a parameter.
    return message.replace("with --crs", "in the parameter CRS")


def crs_text(crs: Any) -> str:
    """Return what trigpoint takes for a CRS parameter: its code, else its WKT, else nothing."""
    return (crs.authid() or crs.toWkt()) if crs.isValid() else ""

"""What hands do to the pairs: they click, type, and walk through them."""

from __future__ import annotations

from collections.abc import Callable

from trigpoint.errors import TrigpointError
from trigpoint_panel.host import Host
from trigpoint_panel.model import Model
from trigpoint_panel.names import isolated
from trigpoint_panel.operators import end_second_operator
from trigpoint_panel.pairs import CALLED, Role, Side
from trigpoint_panel.picking import Picked
from trigpoint_panel.table import PairTable
from trigpoint_panel.views import TwoViews


class Hands:
    """Brings clicks and keys to the model, and the views to where they lead.

    Parameters
    ----------
    host : Host
        Tells what is doubtful.
    model : Model
    views : TwoViews
    table : PairTable
    """

    def __init__(self, host: Host, model: Model, views: TwoViews, table: PairTable) -> None:
        self._host = host
        self._model = model
        self._views = views
        self._table = table

    def take(self, side: Side, picked: Picked) -> None:
        """Take a click in one of the views, and tell what is doubtful about it."""
        try:
            placed = self._model.place(side, picked.xyz, sigma=picked.sigma, note=picked.note)
        except TrigpointError as error:
            self._host.message("error", str(error))
            return
        if placed.warning:
            text = f"{isolated(placed.id)} in the {CALLED[side]}: {placed.warning}"
            keep: tuple[str, Callable[[], object]] = ("Keep", lambda: None)
            self._host.message("warning", text, "", (keep, ("Undo", self._model.undo)))

    def cycle_role(self) -> None:
        """Change the role of the pairs chosen in the table, else of the selected one."""
        self._model.cycle_role(self._chosen())

    def set_role(self, role: Role) -> None:
        """Give the pairs chosen in the table a role, else the selected one."""
        names = self._chosen()
        if names:
            self._model.set_role(names, role)

    def fly_to_chosen(self) -> None:
        """Show the selected pair in both views."""
        if self._model.selected is not None:
            self._views.fly_to(self._model.selected)

    def _chosen(self) -> list[str]:
        return self._table.chosen() or [p.id for p in (self._model.selected,) if p is not None]

    def type_pair(self) -> None:
        """Begin a pair in the table, ready to be typed."""
        name = self._model.new_pair()
        self._table.setFocus()
        index = self._table.index_of(name, "source_x")
        self._table.setCurrentIndex(index)
        self._table.edit(index)

    def walk(self, step: int) -> None:
        """Select the next pair, or the one before, and show it in both views."""
        self._model.select_next(step)
        if self._model.selected is not None:
            self._views.fly_to(self._model.selected)

    def fly(self, name: str) -> None:
        """Select a pair, and show it in both views."""
        self._model.select(name)
        if self._model.selected is not None:
            self._views.fly_to(self._model.selected)

    def fly_to_ghost(self) -> None:
        """Show where the open half should be."""
        ghost = self._model.ghost()
        if ghost is None:
            self._host.message(
                "info", "There is no ghost: it needs a fit, and a pair with one half open."
            )
        else:
            self._views.view(ghost.side).fly_to(ghost.xyz)

    def end_second(self, *, adopt: bool) -> None:
        """End the second operator's round, and tell how far two picks of a place lie apart."""
        found = end_second_operator(self._model, adopt=adopt)
        self._host.message("success", found.statement)

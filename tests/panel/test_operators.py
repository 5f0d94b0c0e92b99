import numpy as np
import pytest

from trigpoint.errors import PicksError
from trigpoint.repeats import picking_sigma
from trigpoint_panel.exchange import import_picks, import_points
from trigpoint_panel.model import Model
from trigpoint_panel.operators import (
    begin_second_operator,
    cancel_second_operator,
    end_second_operator,
    repeatability,
    second_round,
)
from trigpoint_panel.pairs import Pair

PLACES = np.random.default_rng(2).uniform(0, 10, (6, 3))


@pytest.fixture
def model(offset):
    model = Model()
    for place in PLACES:
        model.place("source", place, note="raw 1 2 3")
        model.place("target", 3 * place + offset, sigma=0.2)
    model.edit("P2", "note", "sill [source: raw 1 2 3]")
    model.set_role({"P6"}, "off")
    return model


def test_a_second_operator_sees_names_and_descriptions_alone(model):
    begin_second_operator(model)
    assert [pair.id for pair in model.pairs] == ["P1", "P2", "P3", "P4", "P5"]
    assert all(pair.source is pair.target is None for pair in model.pairs)
    assert [pair.note for pair in model.pairs] == ["", "sill", "", "", ""]
    assert all(pair.sigma_target is None for pair in model.pairs)


def test_a_second_operator_gets_no_ghost(model):
    begin_second_operator(model)
    for place in PLACES[:3]:
        model.place("source", place)
        model.place("target", 3 * place)
    model.place("source", PLACES[3])
    assert model.fit.alignment is not None
    assert model.ghost() is None


def test_a_second_operator_goes_through_the_pairs_in_order_in_one_view_or_both(model):
    begin_second_operator(model)
    assert [model.place("source", place).id for place in PLACES[:5]] == [
        "P1",
        "P2",
        "P3",
        "P4",
        "P5",
    ]
    assert [model.place("target", place).id for place in PLACES[:2]] == ["P5", "P1"]
    with pytest.raises(PicksError, match="picked again"):
        model.place("source", [0, 0, 0])


def test_the_picking_sigma_is_that_of_the_engine_and_the_first_picks_return(model, offset):
    first = model.pairs
    rng = np.random.default_rng(7)
    begin_second_operator(model)
    again = PLACES + rng.normal(scale=0.02, size=PLACES.shape)
    target = 3 * PLACES + offset + rng.normal(scale=0.07, size=PLACES.shape)
    for i in range(4):
        model.place("source", again[i])
        model.place("target", target[i])
    found = end_second_operator(model, adopt=False)
    assert model.pairs == first
    expected = picking_sigma([PLACES[:4], again[:4]])
    assert found.source.sigma == pytest.approx(expected.sigma, rel=1e-12)
    assert found.target.dof == 12
    assert found.statement.startswith(
        f"Picking in the source is good to {expected.sigma:.3g} units"
    )
    assert "Picking in the target is good to 0.0" in found.statement
    model.undo()
    assert model.state.is_second_operator
    assert sum(pair.is_complete for pair in model.pairs) == 4


def test_sigmas_are_adopted_where_none_is_stated(model):
    begin_second_operator(model)
    for place in PLACES[:5]:
        model.place("source", place + 0.01)
        model.place("target", 3 * place + 1)
    found = end_second_operator(model, adopt=True)
    assert {pair.sigma_source for pair in model.pairs} == {found.source.sigma}
    assert {pair.sigma_target for pair in model.pairs} == {0.2}
    assert "the operators differ systematically" in found.statement
    model.undo()
    model.undo()


def test_a_round_without_a_pick_says_so_and_can_be_given_up(model):
    first = model.pairs
    begin_second_operator(model)
    model.place("source", [0, 0, 0])
    cancel_second_operator(model)
    assert model.pairs == first
    begin_second_operator(model)
    found = end_second_operator(model, adopt=True)
    assert found.statement == "No place was picked twice."
    assert model.pairs == first


def test_a_dropped_half_keeps_its_row(model):
    begin_second_operator(model)
    model.place("source", [0, 0, 0])
    assert model.drop_open_half() == "P1"
    assert len(model.pairs) == 5


def test_a_round_refuses_what_would_mix_the_two(model, tmp_path):
    for change in (
        lambda: end_second_operator(model, adopt=True),
        lambda: cancel_second_operator(model),
    ):
        with pytest.raises(PicksError, match="No second operator"):
            change()
    begin_second_operator(model)
    for change in (
        lambda: begin_second_operator(model),
        model.new_pair,
        lambda: model.rename("P1", "x"),
        lambda: import_picks(model, tmp_path / "picks.csv"),
        lambda: import_points(model, tmp_path / "list.txt", "source"),
    ):
        with pytest.raises(PicksError):
            change()
    with pytest.raises(PicksError, match="no pair to pick again"):
        begin_second_operator(Model())


def test_a_pair_picked_on_one_side_is_compared_there():
    first = (Pair("a", source=(0.0, 0.0, 0.0)), Pair("b", target=(1.0, 1.0, 1.0)))
    assert len(second_round(first)) == 2
    found = repeatability(first, (Pair("a", source=(0.1, 0.0, 0.0)),))
    assert found.source.dof == 3
    assert found.target is None

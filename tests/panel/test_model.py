from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trigpoint.errors import PicksError, ProjectError
from trigpoint.similarity import Similarity
from trigpoint_panel.model import Model
from trigpoint_panel.state import State

CORNERS = np.array([[x, y, z] for z in (0, 12) for y in (0, 6) for x in (0, 8)], float)


@pytest.fixture
def tower(similarity_from, offset):
    """A model with six pairs of a building, and the similarity that they were made with."""
    truth = similarity_from(5, offset)
    model = Model()
    noise = np.random.default_rng(1).normal(scale=0.02, size=CORNERS.shape)
    for source, target in zip(CORNERS[:6], (truth(CORNERS) + noise)[:6], strict=True):
        model.place("source", source)
        model.place("target", target)
    return model, truth


def test_clicks_make_one_pair_a_row_in_either_order():
    model = Model()
    assert model.place("source", [1, 2, 3]).id == "P1"
    assert model.selected.is_half_open
    assert model.place("target", [4, 5, 6]).id == "P1"
    assert model.place("target", [7, 8, 9]).id == "P2"
    assert model.place("source", [0, 0, 1]).id == "P2"
    assert [pair.is_complete for pair in model.pairs] == [True, True]


def test_a_click_fills_the_selected_row_first():
    model = Model()
    model.place("source", [1, 2, 3])
    model.place("source", [4, 5, 6])
    assert [pair.id for pair in model.pairs] == ["P1", "P2"]
    model.select("P1")
    assert model.place("target", [0, 0, 0]).id == "P1"
    assert model.place("target", [0, 0, 1]).id == "P2"


def test_undo_and_redo_go_through_every_step_with_its_name(tower):
    model, _ = tower
    model.select("P2")
    model.set_role({"P2"}, "check")
    model.rename("P2", "sill")
    model.move("sill", "target", [1, 2, 3])
    model.delete({"sill", "P3"})
    states, texts = [model.state], []
    while model.undo_text:
        texts.append(model.undo_text)
        model.undo()
        states.append(model.state)
    assert texts[:5] == [
        "Delete 2 pairs",
        "Move sill in the target",
        "Rename P2 to sill",
        "Set P2 to check",
        "Complete P6 in the target",
    ]
    assert texts[-1] == "Pick P1 in the source"
    assert model.state == State()
    for state in reversed(states[:-1]):
        model.redo()
        assert model.pairs == state.pairs
    assert not model.redo_text
    model.redo()
    model.undo()
    model.new_pair()
    assert not model.redo_text


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 7), st.integers(0, 4), st.booleans()), max_size=25))
def test_undoing_all_and_redoing_all_changes_nothing(steps):
    model = Model()
    for number, (kind, which, is_source) in enumerate(steps):
        side = "source" if is_source else "target"
        name = model.pairs[which % len(model.pairs)].id if model.pairs else "P1"
        if kind < 3 or not model.pairs:
            model.place(side, [number, kind, which])
        elif kind == 3:
            model.delete({name})
        elif kind == 4:
            model.cycle_role({name})
        elif kind == 5:
            model.select(name)
        elif kind == 6:
            model.reopen(name, side)
        else:
            model.drop_open_half()
        assert model.state.selected in (None, *(pair.id for pair in model.pairs))
    last = model.pairs
    count = 0
    while model.undo_text:
        model.undo()
        count += 1
    assert model.pairs == ()
    for _ in range(count):
        model.redo()
    assert model.pairs == last


def test_selecting_and_opening_clouds_are_no_steps(tmp_path, tower):
    model, _ = tower
    text = model.undo_text
    model.select("P1")
    model.open_cloud("source", tmp_path / "a.ply")
    model.open_cloud("target", tmp_path / "b.laz")
    assert model.undo_text == text
    model.undo()
    assert model.state.source_path == tmp_path / "a.ply"
    assert model.state.target_path == tmp_path / "b.laz"


def test_what_changes_nothing_is_no_step(tower):
    model, _ = tower
    text = model.undo_text
    model.set_role({"P1"}, "control")
    model.rename("P1", " P1 ")
    model.delete({"nobody"})
    model.edit("P1", "source_x", repr(model.pairs[0].source[0]))
    model.set_alignment(seed=42)
    assert model.undo_text == text


def test_listeners_are_told_after_every_change():
    model, seen = Model(), []
    model.changed.append(lambda: seen.append(len(model.pairs)))
    model.place("source", [1, 2, 3])
    model.select("P1")
    model.undo()
    model.select(None)
    assert seen == [1, 0]


def test_the_open_half_is_dropped_and_nothing_else(tower):
    model, _ = tower
    assert model.drop_open_half() is None
    model.place("target", [1, 2, 3])
    assert model.drop_open_half() == "P7"
    assert len(model.pairs) == 6


def test_a_half_is_opened_again_and_picked_anew(tower):
    model, truth = tower
    model.select("P5")
    model.edit("P2", "target_y", " ")
    assert model.undo_text == "Open P2 in the target"
    assert model.half_open.id == "P2"
    placed = model.place("target", truth(CORNERS[1:2])[0])
    assert (placed.id, placed.warning) == ("P2", "")


def test_a_pair_whose_only_half_is_emptied_stays_to_be_picked(tower):
    model, _ = tower
    model.place("source", [1, 2, 3])
    model.edit("P7", "source_x", "")
    assert [pair.id for pair in model.pairs][-1] == "P7"
    model.edit("P7", "source_x", "5")
    assert model.draft("P7", "source") == (5.0, None, None)
    model.edit("P7", "source_x", "")
    assert model.draft("P7", "source") == (None, None, None)
    assert model.place("source", [1, 2, 3]).id == "P7"


def test_a_ghost_needs_three_pairs_and_stands_where_the_corner_is(tower):
    model, truth = tower
    few = Model()
    for corner in CORNERS[:2]:
        few.place("source", corner)
        few.place("target", truth(corner[None])[0])
    few.place("source", CORNERS[2])
    assert few.ghost() is None

    model.place("source", CORNERS[7])
    ghost = model.ghost()
    assert (ghost.label, ghost.side, ghost.pairs) == ("P7?", "target", 6)
    assert np.linalg.norm(truth(CORNERS[7:])[0] - ghost.xyz) < 0.1
    model.drop_open_half()
    model.place("target", truth(CORNERS[7:])[0])
    ghost = model.ghost()
    assert ghost.side == "source"
    assert np.linalg.norm(CORNERS[7] - ghost.xyz) * truth.scale < 0.1


@pytest.mark.parametrize("side", ["source", "target"])
def test_a_click_far_from_its_ghost_is_doubted_in_metres(tower, side):
    model, truth = tower
    other = "target" if side == "source" else "source"
    places = {"source": CORNERS[7], "target": truth(CORNERS[7:])[0]}
    model.place(other, places[other])
    unit = truth.scale if side == "source" else 1.0
    placed = model.place(side, places[side] + [2.3 / unit, 0, 0])
    assert placed.warning in {
        f"{apart:.1f} m from where 6 pairs put it. Keep?" for apart in (2.2, 2.3, 2.4)
    }
    model.undo()
    assert model.place(side, places[side] + [0.9 / unit, 0, 0]).warning == ""


def test_a_click_on_another_pairs_point_is_doubted(tower):
    model, _ = tower
    assert (
        model.place("source", model.pairs[2].source).warning == "That is P3's point already. Keep?"
    )


def test_roles_go_round(tower):
    model, _ = tower
    for role in ("check", "off", "control"):
        model.cycle_role({"P1", "P2"})
        assert {pair.role for pair in model.pairs[:2]} == {role}
    assert model.undo_text == "Set 2 pairs to control"


def test_the_next_pair_is_selected_round_and_round(tower):
    model, _ = tower
    model.select(None)
    seen = []
    for _ in range(7):
        model.select_next()
        seen.append(model.state.selected)
    assert seen == ["P1", "P2", "P3", "P4", "P5", "P6", "P1"]
    model.select_next(-1)
    assert model.state.selected == "P6"
    model.select(None)
    model.select_next(-1)
    assert model.state.selected == "P6"


def test_a_pair_can_be_typed_cell_by_cell_or_whole():
    model = Model()
    name = model.new_pair()
    model.edit(name, "source_x", "1.5")
    model.edit(name, "source_z", "-3,25")
    assert model.draft(name, "source") == (1.5, None, -3.25)
    assert model.pairs[0].source is None
    model.edit(name, "source_y", "2")
    assert model.pairs[0].source == (1.5, 2.0, -3.25)
    model.edit(name, "target_x", "741008.4, 4279056.3, 153.8")
    assert model.pairs[0].target == (741008.4, 4279056.3, 153.8)
    model.edit(name, "target_z", "150")
    model.edit(name, "sigma_target", "0.05")
    model.edit(name, "note", "sill,\nnorth")
    model.edit(name, "role", " Check")
    model.edit(name, "id", "sill")
    pair = model.pairs[0]
    assert pair.target == (741008.4, 4279056.3, 150.0)
    assert (pair.id, pair.role, pair.sigma_target, pair.note) == (
        "sill",
        "check",
        0.05,
        "sill, north",
    )
    model.edit("sill", "sigma_target", "")
    assert model.pairs[0].sigma_target is None


def test_what_was_typed_is_forgotten_with_its_pair_or_its_pick():
    model = Model()
    name = model.new_pair()
    model.edit(name, "source_x", "1")
    model.edit(name, "target_x", "1")
    model.place("source", [4, 5, 6])
    assert model.draft(name, "source") == (None, None, None)
    assert model.draft(name, "target") == (1.0, None, None)
    model.undo()
    model.undo()
    assert model.new_pair() == name
    assert model.draft(name, "target") == (None, None, None)


@pytest.mark.parametrize(
    ("column", "text", "words"),
    [
        ("source_x", "abc", "not a number"),
        ("source_x", "1 2", "not a coordinate"),
        ("source_x", "nan", "not a number"),
        ("source_x", "1,234.5", "not a number"),
        ("source_x", "1_0", "not a number"),
        ("sigma_source", "-1", "above zero"),
        ("sigma_target", "1e308", "up to 1,000,000"),
        ("sigma_target", "1e-320", "from 1e-09"),
        ("source_x", "1e13", "no coordinate"),
        ("role", "checker", "control, check or off"),
        ("id", "P2", "already"),
    ],
)
def test_what_a_cell_cannot_hold_is_refused_in_a_sentence(tower, column, text, words):
    model, _ = tower
    before = model.state
    with pytest.raises(PicksError, match=words):
        model.edit("P1", column, text)
    assert model.state == before


def test_settings_out_of_range_are_refused_before_they_are_taken(tower):
    model, _ = tower
    before = model.state
    for change, words in (
        (lambda: model.set_alignment(threshold_m=0), "threshold_m"),
        (lambda: model.set_alignment(seed=-1), "seed"),
        (lambda: model.set_comparison(zones=(0.6, 0.3)), "zones"),
        (lambda: model.set_about(id="a b"), "id"),
        (lambda: model.set_about(status="issued"), "date"),
    ):
        with pytest.raises(ProjectError, match=words):
            change()
    assert model.state == before
    model.set_comparison(zones=[0.2, 0.5], margin_m=None)
    assert model.state.comparison.zones == (0.2, 0.5)
    assert model.undo_text == "Change comparison settings"


def test_an_adopted_refinement_goes_with_the_pairs_it_refined(tower):
    model, _ = tower
    refined = Similarity(2.0, np.eye(3), np.ones(3))
    model.adopt(refined)
    assert model.similarity.scale == 2.0
    assert np.array_equal(model.similarity.rotation, np.eye(3))
    model.place("source", [3, 3, 3])
    assert model.similarity.scale == 2.0
    model.place("target", [3, 3, 3])
    assert model.state.adopted is None
    model.undo()
    assert model.similarity.scale == 2.0
    model.discard_adopted()
    assert model.similarity is model.fit.similarity


def test_results_are_stale_when_something_that_enters_them_changes(tower):
    model, _ = tower
    assert not model.is_stale
    model.mark_reported()
    assert not model.is_stale
    model.place("source", [1, 1, 1])
    model.edit("P1", "note", "said")
    model.select("P2")
    assert not model.is_stale
    model.set_role({"P1"}, "check")
    assert model.is_stale
    model.undo()
    assert not model.is_stale
    model.set_comparison(voxel_m=0.2)
    assert model.is_stale


def test_a_report_is_of_the_state_that_it_was_asked_for(tower, tmp_path):
    model, _ = tower
    asked = model.state
    model.set_project(replace(asked.project, path=tmp_path / "project.toml"))
    model.mark_reported(asked)
    assert not model.is_stale
    model.delete({"P1"})
    model.mark_reported(asked)
    assert model.is_stale


def test_another_session_leaves_nothing_to_undo(tower):
    model, _ = tower
    model.mark_reported()
    model.load(replace(State(), pairs=model.pairs[:3]))
    assert (model.undo_text, model.is_stale, len(model.pairs)) == ("", False, 3)


def test_a_pair_that_is_not_there_is_refused(tower):
    model, _ = tower
    for change in (
        lambda: model.move("x", "source", [1, 2, 3]),
        lambda: model.rename("x", "y"),
        lambda: model.edit("x", "note", ""),
    ):
        with pytest.raises(PicksError, match="no pair 'x'"):
            change()

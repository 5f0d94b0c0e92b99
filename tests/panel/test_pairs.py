import numpy as np
import pandas as pd
import pytest

from trigpoint.errors import PicksError
from trigpoint.picks import picks_from
from trigpoint_panel.pairs import (
    Pair,
    annotated,
    complete,
    from_picks,
    next_id,
    place_of,
    refuse_taken,
    to_picks,
    waiting,
    with_role,
)

HALF = (1.0, 2.0, 3.0)


def test_a_pair_is_complete_half_open_or_blank():
    assert not Pair("P1").is_complete
    assert not Pair("P1").is_half_open
    assert Pair("P1").open_side is None
    assert Pair("P1", source=HALF).open_side == "target"
    assert Pair("P1", target=HALF).open_side == "source"
    whole = Pair("P1", source=HALF, target=HALF)
    assert whole.is_complete
    assert whole.open_side is None


def test_a_half_takes_its_sigma_and_its_snap_with_it():
    pair = Pair("P1", note="sill").placed("source", HALF, sigma=0.02, note="corner [of] planes")
    pair = pair.placed("target", HALF, sigma=0.07, note="highest")
    assert pair.note == "sill [source: corner [of) planes] [target: highest]"
    moved = pair.placed("source", (4.0, 5.0, 6.0))
    assert (moved.sigma_source, moved.sigma_target) == (None, 0.07)
    assert moved.note == "sill [target: highest]"
    opened = moved.placed("target", None)
    assert (opened.target, opened.sigma_target, opened.note) == (None, None, "sill")


def test_notes_of_other_files_survive_the_snaps_own():
    assert annotated("[see photo 3]", "source", "centroid") == "[see photo 3] [source: centroid]"


def test_a_click_fills_the_selected_pair_then_the_last_open_one_then_a_new_one():
    pairs = (Pair("P1", source=HALF), Pair("P2", source=HALF), Pair("P3", source=HALF))
    assert waiting(pairs, "P1", "target").id == "P1"
    assert waiting(pairs, None, "target").id == "P3"
    assert waiting(pairs, None, "target", newest=False).id == "P1"
    assert waiting(pairs, "P1", "source") is None


def test_ids_count_on_from_the_largest():
    assert next_id(()) == "P1"
    assert next_id((Pair("P9"), Pair("P010"), Pair("Px"))) == "P11"


def test_a_name_is_refused_when_empty_or_taken():
    assert refuse_taken((Pair("P1"),), " roof ") == "roof"
    with pytest.raises(PicksError, match="needs a name"):
        refuse_taken((), "  ")
    with pytest.raises(PicksError, match="'P1' already"):
        refuse_taken((Pair("P1"),), "P1 ")


def test_picks_become_pairs_and_picks_again(offset):
    rng = np.random.default_rng(3)
    source, target = rng.normal(size=(4, 3)), rng.normal(size=(4, 3)) + offset
    picks = picks_from(
        ["a", "b", "c", "d"],
        source,
        target,
        roles=["control", "check", "off", "control"],
        sigma_source=[0.1, np.nan, 0.2, np.nan],
        sigma_target=[np.nan, 0.3, np.nan, np.nan],
        notes=["x", "", "<b>", "y"],
        extra=pd.DataFrame({"photo": ["1", "2", "", "4"]}),
    )
    pairs = from_picks(picks)
    assert pairs[1].sigma_source is None
    assert pairs[1].sigma_target == 0.3
    assert pairs[0].extra == (("photo", "1"),)
    again = to_picks((*pairs, Pair("open", source=HALF)))
    assert again.ids == picks.ids
    assert np.array_equal(again.source, source)
    assert np.array_equal(again.target, target)
    assert again.roles.tolist() == picks.roles.tolist()
    assert np.array_equal(again.sigma_source, picks.sigma_source, equal_nan=True)
    assert again.notes == picks.notes
    assert again.extra["photo"].tolist() == ["1", "2", "", "4"]


def test_no_pairs_are_no_picks():
    assert len(to_picks(())) == 0
    assert from_picks(to_picks(())) == ()


def test_pairs_are_counted_by_role_where_they_are_complete():
    pairs = (Pair("a", "check", HALF, HALF), Pair("b", "check", HALF), Pair("c", "off", HALF, HALF))
    assert [pair.id for pair in complete(pairs)] == ["a", "c"]
    assert [pair.id for pair in with_role(pairs, "check")] == ["a"]


@pytest.mark.parametrize("bad", [(1.0, 2.0), (1.0, np.nan, 2.0), (1e13, 0, 0), [[1, 2, 3]]])
def test_what_is_no_place_is_refused(bad):
    with pytest.raises(PicksError, match="three finite numbers"):
        place_of(bad)

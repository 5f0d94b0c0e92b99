import json
from dataclasses import asdict
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trigpoint_panel.camera import Camera
from trigpoint_panel.documents import FORMAT, SessionError, document_text, read_document
from trigpoint_panel.fingerprints import Fingerprints
from trigpoint_panel.pairs import Pair
from trigpoint_panel.state import State

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=5,
)
PAIRS = (Pair("P1", "check", (0.0, 1.0, 2.0), (3.0, 4.0, 5.0), 0.1, None, "", (("photo", "7"),)),)


def text_of(state, folder):
    return document_text(
        state,
        folder,
        cameras={},
        similarity=None,
        fingerprints=Fingerprints(),
        read={},
        hashing=False,
    )


def places_in(value, path=()):
    """Every place in a document, as the keys that lead there."""
    yield path
    if isinstance(value, dict):
        for key, item in value.items():
            yield from places_in(item, (*path, key))
    elif isinstance(value, list):
        for number, item in enumerate(value):
            yield from places_in(item, (*path, number))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("documents")


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_whatever_stands_in_a_session_file_it_is_read_or_refused(folder, data):
    state = State(pairs=PAIRS, first=PAIRS)
    document = json.loads(text_of(state, folder))
    document["files"]["reference"] = {"path": "lidar.laz", "bytes": 5}
    path = data.draw(st.sampled_from(list(places_in(document))[1:]))
    value, holder = data.draw(JSON), document
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = value
    (folder / "a.trig.json").write_text(json.dumps(document))
    said = ""
    try:
        # What is taken can be saved again.
        text_of(read_document(folder / "a.trig.json").state, folder)
    except SessionError as error:
        said = str(error)
    assert said.startswith("a.trig.json " if said else "")
    assert "\n" not in said


@pytest.mark.parametrize("path", ["a\0b", "", "\ud800", "x" * 5000])
def test_a_path_that_no_system_has_is_no_trap(tmp_path, path):
    document = json.loads(text_of(State(), tmp_path))
    document["files"]["reference"] = {"path": path}
    (tmp_path / "a.trig.json").write_text(json.dumps(document))
    if len(path) > 100:
        (doubt,) = read_document(tmp_path / "a.trig.json").doubts
        assert "is not where the session left it" in doubt
    else:
        with pytest.raises(SessionError, match="is no session"):
            read_document(tmp_path / "a.trig.json")


def test_a_document_says_what_it_is(tmp_path):
    document = json.loads(text_of(State(), tmp_path))
    assert document["format"] == FORMAT
    assert document["files"] == {}
    assert document["project_path"] is None


def test_a_file_from_another_system_is_found(tmp_path):
    document = json.loads(text_of(State(), tmp_path))
    document["files"]["reference"] = {"path": "in\\lidar.laz"}
    document["files"]["reconstruction nerf"] = {"path": "C:\\clouds\\nerf.ply"}
    (tmp_path / "a.trig.json").write_text(json.dumps(document))
    state = read_document(tmp_path / "a.trig.json").state
    assert state.target_path == tmp_path / "in" / "lidar.laz"
    assert state.source_path == Path("C:\\clouds\\nerf.ply")


def test_a_fingerprint_is_taken_again_when_a_file_changes(tmp_path):
    path, known = tmp_path / "a", Fingerprints()
    path.write_text("one")
    assert known.of(path, hashing=False) == {"bytes": 3}
    first = known.of(path)
    assert known.of(path, hashing=False) == first
    path.write_text("three")
    assert known.of(path)["sha256"] != first["sha256"]
    with pytest.raises(OSError, match="No such file"):
        known.of(tmp_path / "gone")


@pytest.mark.parametrize(
    "spoilt",
    [
        {"position": [float("nan")] * 3},
        {"position": [1e308] * 3},
        {"position": [10**400] * 3},
        {"position": [1.0]},
        {"position": [0.0, 0.0, 0.0]},
        {"up": [0, 0, 0]},
        {"up": [1, 2, 3]},
        {"up": "abc"},
        {"view_angle": 0},
        {"view_angle": "x"},
        {"parallel": True, "parallel_scale": -1},
    ],
)
def test_a_camera_that_nothing_is_seen_from_is_left_out(tmp_path, spoilt):
    sound = asdict(Camera((1.0, 2.0, 3.0), (0.0, 0.0, 0.0)))
    document = json.loads(text_of(State(), tmp_path))
    document["cameras"] = {"source": sound | spoilt, "target": sound, "other": 7}
    (tmp_path / "a.trig.json").write_text(json.dumps(document))
    assert list(read_document(tmp_path / "a.trig.json").cameras) == ["target"]


@pytest.mark.parametrize(
    "spoilt",
    [
        {"rotation": [0] * 9},
        {"rotation": [-1, 0, 0, 0, 1, 0, 0, 0, 1]},
        {"rotation": [1, 0, 0, 0, 1, 0, 0, 0, 1.01]},
        {"rotation": [1] * 8, "translation": [0] * 4},
        {"scale": 0},
        {"translation": [float("nan"), 0, 0]},
    ],
)
def test_an_adopted_similarity_that_is_none_is_refused(tmp_path, spoilt):
    sound = {"scale": 3.3, "rotation": [0, -1, 0, 1, 0, 0, 0, 0, 1], "translation": [7, 8, 9]}
    document = json.loads(text_of(State(), tmp_path))
    path = tmp_path / "a.trig.json"
    path.write_text(json.dumps(document | {"adopted": sound}))
    assert read_document(path).state.adopted.scale == 3.3
    path.write_text(json.dumps(document | {"adopted": sound | spoilt}))
    with pytest.raises(SessionError, match="adopted similarity is none"):
        read_document(path)

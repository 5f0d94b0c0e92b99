import re
import sys
from pathlib import Path

import pytest

from trigpoint_qgis import deps

RUNNING = f"{sys.version_info.major}.{sys.version_info.minor}"


def distribution(folder, name, version):
    """Install a package that holds nothing but its own version."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.py").write_text(f"version = {version!r}\n")
    info = folder / f"{name}-{version}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")


@pytest.fixture
def venv(tmp_path):
    """Lay out a virtual environment of a version of Python."""

    def make(version=RUNNING):
        folder = tmp_path / "env"
        packages = folder / "lib" / f"python{version}" / "site-packages"
        packages.mkdir(parents=True)
        (folder / "bin").mkdir()
        (folder / "bin" / "python").touch()
        (folder / "pyvenv.cfg").write_text(f"home = /usr/bin\nversion = {version}.2\n")
        return folder

    return make


@pytest.fixture(autouse=True)
def undisturbed(monkeypatch):
    """Give sys.path back as it was, and forget what was attached."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(deps, "_attached", [])
    monkeypatch.setattr(deps, "_added", [])


def test_what_is_missing_and_what_is_too_old_are_named_with_their_versions(tmp_path):
    distribution(tmp_path, "tp_there", "2.1")
    distribution(tmp_path, "tp_old", "1.9.8")
    sys.path.append(str(tmp_path))
    lacks = deps.lacking({"tp_there": "2.0", "tp_old": "1.10", "tp_missing": "1"})
    assert [str(lack) for lack in lacks] == [
        "tp_old is 1.9.8 and must be 1.10 or later",
        "tp_missing is missing",
    ]
    assert deps.listed(lacks) == (
        "Missing: tp_missing.\ntp_old is 1.9.8 and must be 1.10 or later."
    )
    assert "Missing: tp_missing. tp_old is 1.9.8" in deps.explain(lacks)
    assert deps.explain(()) == ""


@pytest.mark.parametrize("version", ["9.3.1", "9.4.1", "9.4.0.dev0"])
def test_trap_2_vtk_that_crashes_qgis_is_refused_with_the_reason(version, monkeypatch):
    monkeypatch.setattr(deps, "_version", lambda name, _: version if name == "vtk" else "99")
    (lack,) = deps.lacking(deps.PANEL)
    assert "crashes QGIS when it quits" in str(lack)


@pytest.mark.parametrize("version", ["9.4.2", "9.5.0", "10.0"])
def test_vtk_that_does_not_crash_qgis_is_taken(version, monkeypatch):
    monkeypatch.setattr(deps, "_version", lambda *_: version)
    assert deps.lacking(deps.VIEWS) == ()


def test_trap_7_packages_come_after_everything_that_qgis_brings(venv):
    folder = venv()
    before = list(sys.path)
    deps.attach(deps.find_environment(folder))
    added = [entry for entry in sys.path if entry not in before]
    assert str(folder / "lib" / f"python{RUNNING}" / "site-packages") in added
    assert sys.path[: len(before)] == before


def test_trap_7_a_pth_file_that_pushes_to_the_front_is_put_in_its_place(venv, tmp_path):
    folder = venv()
    pushed = tmp_path / "pushed"
    pushed.mkdir()
    packages = folder / "lib" / f"python{RUNNING}" / "site-packages"
    (packages / "push.pth").write_text(f"import sys; sys.path.insert(0, {str(pushed)!r})\n")
    before = list(sys.path)
    deps.attach(deps.find_environment(folder))
    assert sys.path[: len(before)] == before
    assert str(pushed) in sys.path[len(before) :]


def test_attaching_twice_adds_once(venv):
    environment = deps.find_environment(venv())
    deps.attach(environment)
    once = list(sys.path)
    deps.attach(environment)
    assert sys.path == once
    assert deps.attached() == environment


def test_an_environment_chosen_after_another_takes_its_place(venv, tmp_path):
    old = deps.find_environment(venv())
    distribution(tmp_path / "bare", "tp_bare", "1")
    deps.attach(old)
    deps.attach(deps.find_environment(tmp_path / "bare"))
    assert str(old.packages) not in sys.path
    assert str(tmp_path / "bare") in sys.path
    deps.attach(None)
    assert str(tmp_path / "bare") not in sys.path
    assert deps.attached() is None


def test_the_environment_s_own_version_counts_where_its_own_interpreter_runs(tmp_path):
    distribution(tmp_path / "of_qgis", "tp_drawn", "3.6")
    distribution(tmp_path / "env", "tp_drawn", "3.9")
    sys.path.append(str(tmp_path / "of_qgis"))
    environment = deps.find_environment(tmp_path / "env")
    deps.attach(environment)
    assert deps.lacking({"tp_drawn": "3.8"})
    assert not deps.lacking({"tp_drawn": "3.8"}, environment)


def test_a_bare_folder_of_packages_is_taken_without_an_interpreter(tmp_path):
    distribution(tmp_path / "bare", "tp_bare", "1")
    assert deps.find_environment(tmp_path / "bare") == deps.Environment(tmp_path / "bare", None)


def test_an_environment_of_another_python_is_refused_with_both_versions(venv):
    with pytest.raises(deps.FolderError, match=rf"Python 3\.9 and QGIS runs {RUNNING}"):
        deps.find_environment(venv("3.9"))


def test_a_folder_that_is_no_environment_is_refused(tmp_path):
    (tmp_path / "empty").mkdir()
    with pytest.raises(deps.FolderError, match="neither"):
        deps.find_environment(tmp_path / "empty")
    with pytest.raises(deps.FolderError, match="not a folder"):
        deps.find_environment(tmp_path / "none")


def test_the_chosen_folder_comes_before_the_profile_s_own(venv, tmp_path):
    folder = venv()
    own = tmp_path / "profile" / deps.OWN
    distribution(own, "tp_own", "1")
    assert deps.locate("", tmp_path / "profile").packages == own
    assert deps.locate(str(folder), tmp_path / "profile").python == folder / "bin" / "python"
    assert deps.locate("", tmp_path / "nobody") is None


def test_what_is_needed_is_what_pyproject_asks_for():
    tomllib = pytest.importorskip("tomllib")
    path = Path(__file__).parents[2] / "pyproject.toml"
    project = tomllib.loads(path.read_text("utf-8"))["project"]
    extras = project["optional-dependencies"]
    asked = {
        match[1].lower(): match[2]
        for line in [*project["dependencies"], *extras["reporting"], *extras["panel"]]
        if (match := re.match(r"([\w-]+)(?:\[\w+\])?>=([\d.]+)", line))
    }
    # laspy brings lazrs; Qt is QGIS's own, and pye57 is asked for where an E57 is read.
    known = deps.PANEL | deps.REPORT
    assert {name: least for name, least in known.items() if name != "lazrs"} == {
        name: least for name, least in asked.items() if name not in ("pyside6-essentials", "pye57")
    }


def test_the_plugin_s_own_packages_are_forgotten_on_detaching(tmp_path, monkeypatch):
    vendor = tmp_path / "_vendor"
    distribution(vendor, "tp_vendored", "1")
    monkeypatch.setattr(deps, "VENDOR", vendor)
    deps.attach(None)
    __import__("tp_vendored")
    deps.detach()
    assert "tp_vendored" not in sys.modules
    assert str(vendor) not in sys.path

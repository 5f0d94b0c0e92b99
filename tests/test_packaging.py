import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import trigpoint

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The names in a wheel built from this checkout."""
    if not (ROOT / "pyproject.toml").exists():
        pytest.skip("run from an installed copy: there is no checkout to build")
    pytest.importorskip("hatchling", reason="hatchling builds the wheel")
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    (built,) = folder.glob("*.whl")
    assert built.name.startswith(f"trigpoint-{trigpoint.__version__}-")
    with zipfile.ZipFile(built) as archive:
        return archive.namelist()


def test_the_wheel_holds_the_four_packages_and_nothing_else(wheel):
    tops = {name.split("/")[0] for name in wheel if ".dist-info" not in name}
    assert tops == {"trigpoint", "trigpoint_reporting", "trigpoint_panel", "trigpoint_templates"}


@pytest.mark.parametrize("root", ["core", "reporting", "plugin", "templates"])
def test_the_wheel_holds_every_file_of_a_source_root(wheel, root):
    tracked = subprocess.run(
        ["git", "ls-files", root], cwd=ROOT, check=False, capture_output=True, text=True
    ).stdout.split()
    if not tracked:
        pytest.skip("no git here to say which files belong")
    package = {path.split("/", 1)[1] for path in tracked if path.count("/") > 1}
    assert package
    assert package - {path for path in package if path.startswith("trigpoint_qgis")} <= set(wheel)


def test_the_version_is_literal():
    # Inside QGIS there is no package metadata to ask.
    text = (ROOT / "core" / "trigpoint" / "__init__.py").read_text("utf-8")
    assert f'__version__ = "{trigpoint.__version__}"' in text

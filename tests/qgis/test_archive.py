import importlib.util
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import trigpoint

ROOT = Path(__file__).parents[2]
PLUGIN = ROOT / "plugin" / "trigpoint_qgis"

spec = importlib.util.spec_from_file_location("make_zip", ROOT / "plugin" / "make_zip.py")
make_zip = importlib.util.module_from_spec(spec)
spec.loader.exec_module(make_zip)


@pytest.fixture
def altered(archive, tmp_path):
    """Rewrite the archive: files taken out, added, or their text replaced."""

    def make(*, without=(), added=None, metadata=None):
        made = tmp_path / archive.name
        with zipfile.ZipFile(archive) as old, zipfile.ZipFile(made, "w") as new:
            for name in old.namelist():
                if name in without:
                    continue
                content = old.read(name)
                if metadata and name.endswith("/metadata.txt"):
                    content = metadata(content.decode()).encode()
                new.writestr(name, content)
            for name in added or ():
                new.writestr(name, b"x")
        return make_zip.refusals(made)

    return make


def test_the_archive_passes_what_the_repository_asks(archive):
    assert make_zip.refusals(archive) == []
    assert archive.stat().st_size < 3_000_000


def test_the_same_checkout_gives_the_same_bytes(archive, tmp_path):
    assert make_zip.build(tmp_path).read_bytes() == archive.read_bytes()


def test_the_archive_holds_the_project_s_packages_and_its_licences(archive):
    with zipfile.ZipFile(archive) as file:
        names = set(file.namelist())
        gpl = file.read("trigpoint_qgis/LICENSE").decode()
    for package in ("trigpoint", "trigpoint_reporting", "trigpoint_panel", "trigpoint_templates"):
        assert f"trigpoint_qgis/_vendor/{package}/__init__.py" in names
    assert "GNU GENERAL PUBLIC LICENSE" in gpl
    assert "Version 2, June 1991" in gpl
    assert "trigpoint_qgis/_vendor/LICENSE" in names
    assert any(name.endswith("LICENSE-IBM-Plex.txt") for name in names)


def test_the_archive_s_metadata_states_the_package_s_version():
    assert make_zip.metadata(PLUGIN)["version"] == trigpoint.__version__


def test_requirements_hold_every_dependency_and_no_qt():
    found = make_zip.requirements()
    names = {re.split(r"[\[<>=~! ]", line)[0].lower() for line in found}
    assert {"numpy", "pandas", "laspy", "pyvista", "pyvistaqt", "weasyprint", "vtk"} <= names
    assert not [name for name in names if name.startswith(("pyqt", "pyside"))]
    assert "vtk>=9.4.2" in found
    assert found == sorted(set(found))


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("trigpoint_qgis/a.pyc", "binary"),
        ("trigpoint_qgis/run.sh", "script"),
        ("trigpoint_qgis/core.so", "binary"),
        ("trigpoint_qgis/__pycache__/a.py", "may not"),
        ("trigpoint_qgis/.git/config", "may not"),
        ("trigpoint_qgis/.hidden", "may not"),
        ("trigpoint_qgis/../evil.py", "may not"),
        ("trigpoint_qgis\\evil.py", "may not"),
        ("other/a.py", "one folder"),
    ],
)
def test_a_file_that_does_not_belong_is_refused(altered, name, said):
    # zipfile would turn a backslash into a slash.
    if "\\" in name:
        assert any(said in fault for fault in make_zip._name_faults([name]))
    else:
        assert any(said in fault for fault in altered(added=[name]))


@pytest.mark.parametrize("name", ["metadata.txt", "__init__.py", "LICENSE"])
def test_a_missing_file_is_refused(altered, name):
    assert any(name in fault for fault in altered(without=[f"trigpoint_qgis/{name}"]))


@pytest.mark.parametrize("key", make_zip.REQUIRED)
def test_metadata_without_a_required_key_is_refused(altered, key):
    def drop(text):
        return re.sub(rf"(?m)^{key}=.*\n(?: .*\n)*", "", text)

    assert any(f"no {key}" in fault for fault in altered(metadata=drop))


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("name=Trigpoint plugin", "word plugin"),
        ("description=<b>bold</b>", "plain text"),
        ("author=A/B", "slash"),
        ("supportsQt6=True\nname=T", "supportsQt6"),
        ("tracker=http://trigpoint.invalid", "https"),
        ("icon=none.svg", "icon"),
        ("qgisMinimumVersion=three", "qgisMinimumVersion"),
    ],
)
def test_metadata_that_breaks_a_rule_is_refused(altered, line, said):
    key = line.splitlines()[-1].split("=")[0]

    def change(text):
        return re.sub(rf"(?m)^{key}=.*$", line, text)

    assert any(said in fault for fault in altered(metadata=change))


def test_placeholder_addresses_are_refused_only_when_publishing(archive):
    assert any("placeholder" in fault for fault in make_zip.refusals(archive, publish=True))


def test_the_command_leaves_nothing_where_it_refuses(tmp_path):
    done = subprocess.run(
        [sys.executable, ROOT / "plugin" / "make_zip.py", "--out", tmp_path, "--publish"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "placeholder" in done.stderr
    assert not list(tmp_path.iterdir())


def test_the_plugin_s_files_hold_no_path_of_a_machine(archive):
    home = re.compile(rb"/(home|root|work|tmp)/\w")
    with zipfile.ZipFile(archive) as file:
        own = [name for name in file.namelist() if "/_vendor/" not in name]
        assert not [name for name in own if home.search(file.read(name))]


def test_the_template_of_translations_holds_what_the_plugin_says():
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            "import make_translations as m; print(m.template() == m.TEMPLATE.read_text('utf-8'))",
        ],
        cwd=ROOT / "plugin",
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == "True", "run python plugin/make_translations.py"


def test_the_help_asks_nothing_of_the_network(archive):
    with zipfile.ZipFile(archive) as file:
        page = file.read("trigpoint_qgis/help/index.html").decode()
    assert not re.search(r"(src|href)=|url\(|@import", page)
    for name in ("align", "apply", "compare", "audit"):
        assert f"trigpoint:{name}" in page

"""Where the plugin's tests find QGIS: in this Python for some, as a program for others.

Those that import nothing of QGIS run everywhere. The rest skip with a reason where it is missing;
`.ci/qgis.sh` sets up what they need.
"""

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DRIVERS = Path(__file__).with_name("drivers")
collect_ignore = ["drivers"]  # programs that run inside QGIS
ENVIRONMENT = os.environ.get("TRIGPOINT_QGIS_ENVIRONMENT")

try:
    import qgis.core
except ImportError:
    qgis = None


def pytest_configure(config):
    if qgis is not None:
        # Those of QGIS's and GDAL's own modules, and of Debian's older packages, are not ours.
        for line in (
            "ignore:builtin type (SwigPy|swigvar)",
            "ignore:.*:DeprecationWarning:(qgis|osgeo|pyproj|processing|plugins|pytest_qgis)",
            "ignore:sipPyTypeDict",
            "ignore:.*unclosed.*:ResourceWarning",
        ):
            config.addinivalue_line("filterwarnings", line)


@pytest.fixture(scope="session")
def pyqgis():
    """Skip where this Python is not QGIS's."""
    if qgis is None:
        pytest.skip("this Python is not QGIS's; .ci/qgis.sh makes one that is")
    pytest.importorskip("pytest_qgis", reason="pytest-qgis is not installed")
    return qgis


@pytest.fixture(scope="session")
def archive(tmp_path_factory):
    """The plugin's zip, built from this checkout."""
    built = subprocess.run(
        [sys.executable, ROOT / "plugin" / "make_zip.py", "--out", tmp_path_factory.mktemp("zip")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    return Path(built.stdout.split("  ")[0])


@pytest.fixture(scope="session")
def real_qgis():
    """Return the environment beside a QGIS that can be started, or skip with the reason.

    Where it is named, it must be there: a test that skips in silence tests nothing.
    """
    if not ENVIRONMENT:
        pytest.skip("TRIGPOINT_QGIS_ENVIRONMENT is not set: it names what .ci/qgis.sh made")
    for program in ("qgis", "qgis_process", "xvfb-run", "unshare"):
        assert shutil.which(program), f"{program} is not installed; .ci/qgis.sh installs it"
    assert (Path(ENVIRONMENT) / "bin" / "python").exists(), f"{ENVIRONMENT} is no environment"
    alone = subprocess.run(["unshare", "-n", "true"], capture_output=True, check=False)
    assert alone.returncode == 0, "no network namespace can be made here"
    return Path(ENVIRONMENT)


@pytest.fixture
def profile(tmp_path):
    """Make a QGIS profile that asks nothing of the network, with the settings given."""
    home = tmp_path / "home"
    (home / "run").mkdir(parents=True, mode=0o700)
    folder = tmp_path / "config" / "profiles" / "default"
    (folder / "QGIS").mkdir(parents=True)

    def make(*, python_env="", installed=None):
        lines = [
            "[qgis]",
            "checkVersion=false",
            "[app]",
            r"news-feed\disabled=true",
            r"plugin_installer\checkOnStart=false",
            "[trigpoint]",
            f"python_env={python_env}",
        ]
        if installed is not None:
            lines += ["[PythonPlugins]", "trigpoint_qgis=true"]
        (folder / "QGIS" / "QGIS3.ini").write_text("\n".join(lines) + "\n")
        if installed is not None:
            with zipfile.ZipFile(installed) as file:
                file.extractall(folder / "python" / "plugins")
        return folder

    make.home, make.root = home, folder.parents[1]
    return make


@pytest.fixture
def run_qgis(real_qgis, profile, tmp_path):  # noqa: ARG001
    """Start real QGIS without network on a display of its own, and run a driver in it."""

    def run(driver, *, screen="1600x1000", seconds=170, alone=True, **given):
        told = tmp_path / "told.json"
        variables = _variables(profile) | {
            "TRIGPOINT_GIVEN": json.dumps({key: str(value) for key, value in given.items()}),
            "TRIGPOINT_DRIVERS": str(DRIVERS),
            "TRIGPOINT_TOLD": str(told),
            "TRIGPOINT_SHOTS": os.environ.get("TRIGPOINT_SHOTS") or str(tmp_path),
        }
        for name in ("QT_QPA_PLATFORM", "DISPLAY", "PYTHONPATH"):
            variables.pop(name, None)
        command = ["unshare", "-n"] if alone else []
        command += ["xvfb-run", "-a", "-s", f"-screen 0 {screen}x24", "qgis"]
        command += ["--profiles-path", str(profile.root), "--nologo", "--noversioncheck"]
        ended = _ended([*command, "--code", str(DRIVERS / f"{driver}.py")], variables, seconds)
        tail = (ended.stdout + ended.stderr)[-6000:]
        assert told.exists(), f"the driver said nothing, code {ended.returncode}: {tail}"
        found = json.loads(told.read_text())
        assert not found["errors"], "\n".join(found["errors"])
        assert ended.returncode == 0, tail
        return found["said"]

    return run


@pytest.fixture
def qgis_process(real_qgis, profile, archive):
    """Run one algorithm of the installed plugin, without a window or network; its JSON."""
    profile(python_env=real_qgis, installed=archive)

    def run(*arguments, seconds=170):
        variables = _variables(profile) | {"QT_QPA_PLATFORM": "offscreen"}
        variables["QGIS_CUSTOM_CONFIG_PATH"] = str(profile.root)
        variables.pop("PYTHONPATH", None)
        # Debian's script round the program of 3.22 hands it an option that it does not know.
        program = "qgis_process.bin" if shutil.which("qgis_process.bin") else "qgis_process"
        command = ["unshare", "-n", program, "--json", "run", *map(str, arguments)]
        return _ended(command, variables, seconds)

    return run


def _ended(command, variables, seconds):
    return subprocess.run(
        command,
        env=variables,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=seconds,
        check=False,
    )


def _variables(profile):
    return os.environ | {
        "HOME": str(profile.home),
        "XDG_RUNTIME_DIR": str(profile.home / "run"),
        "LC_ALL": "C.UTF-8",
    }

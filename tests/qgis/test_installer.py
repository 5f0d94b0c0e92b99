import sys
import time
import zipfile
from importlib import metadata
from pathlib import Path

import pytest

from trigpoint_qgis import auditing, child, deps, installer

PYTHON = sys.executable


@pytest.mark.parametrize(
    ("log", "said"),
    [
        ("SSLError(SSLCertVerificationError(1, '[SSL: CERTIFICATE_VERIFY_FAILED]", "certificate"),
        ("ProxyError('Cannot connect to proxy.', OSError('407 Proxy", "proxy"),
        ("OSError: [Errno 28] No space left on device", "disk is full"),
        ("NewConnectionError: Failed: [Errno -3] Temporary failure in name resolution", "network"),
        ("No module named ensurepip", "python3-venv"),
        ("because ensurepip is not\navailable.  On Debian/Ubuntu", "python3-venv"),
        ("/usr/bin/python3: No module named venv", "python3-venv"),
        ("PermissionError: [Errno 13] Permission denied: '/opt/x'", "can't be written"),
        ("ERROR: No matching distribution found for vtk>=9.4.2", "no build"),
        ("something else", "see the log"),
    ],
)
def test_a_failure_is_told_in_one_sentence(log, said):
    assert said in installer.classify(log)


def test_the_commands_pin_what_qgis_has_and_see_its_packages(tmp_path):
    make, fill = installer.commands(tmp_path / "env", "/usr/bin/python3", tmp_path / "req.txt")
    assert make[:3] == ["/usr/bin/python3", "-m", "venv"]
    assert "--system-site-packages" in make
    assert f"numpy=={metadata.version('numpy')}" in fill
    assert fill[0] == str(tmp_path / "env" / "bin" / "python")
    text = installer.as_text([make, fill])
    assert text.count("\n") == 1
    assert text.startswith("/usr/bin/python3 -m venv")


def wheel(folder, name):
    """Build the wheel of a package that holds one number."""
    folder.mkdir()
    info = f"{name}-1.0.dist-info"
    with zipfile.ZipFile(folder / f"{name}-1.0-py3-none-any.whl", "w") as file:
        file.writestr(f"{name}.py", "answer = 42\n")
        file.writestr(f"{info}/METADATA", f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        file.writestr(
            f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        )
        file.writestr(f"{info}/RECORD", "")


def test_an_installation_makes_an_environment_that_can_be_used(tmp_path, monkeypatch):
    base = child.base_python()
    if child.run([str(base), "-c", "import ensurepip, venv"])[0] != 0:
        pytest.skip(f"{base} can't make environments: install its venv")
    wheel(tmp_path / "wheels", "tp_installed")
    (tmp_path / "requirements.txt").write_text("tp-installed\n")
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(tmp_path / "wheels"))
    # Those of the running Python; its base may have none.
    monkeypatch.setattr(installer, "PINNED", ())
    lines = []
    installer.install(tmp_path / "a folder", tmp_path / "requirements.txt", on_line=lines.append)
    assert any("Successfully installed" in line for line in lines)
    environment = deps.find_environment(tmp_path / "a folder")
    code, said = child.run(
        [str(environment.python), "-c", "import tp_installed; print(tp_installed.answer)"]
    )
    assert (code, said.strip()) == (0, "42")
    assert deps.lacking({"tp-installed": "1.0"}, environment) == ()


def test_a_child_sees_a_bare_folder_of_packages(tmp_path, monkeypatch):
    (tmp_path / "tp_bare_only.py").write_text("answer = 42\n")
    monkeypatch.delenv("PYTHONPATH", raising=False)
    command = auditing.interpreter(deps.Environment(tmp_path, None))
    code = "import subprocess, sys, tp_bare_only\n"
    # As the report's own process does.
    code += "sys.exit(subprocess.call([sys.executable, '-c', 'import tp_bare_only']))"
    assert child.run([*command, "-c", code])[0] == 0


def test_a_failed_installation_leaves_nothing_and_keeps_its_log(tmp_path):
    fake = tmp_path / "python"
    fake.write_text("#!/bin/sh\nmkdir -p $5/bin; echo 'No module named ensurepip' >&2; exit 1\n")
    fake.chmod(0o755)
    lines = []
    with pytest.raises(installer.InstallError, match="python3-venv") as caught:
        installer.install(
            tmp_path / "env", tmp_path / "r.txt", on_line=lines.append, find_python=lambda: fake
        )
    assert not (tmp_path / "env").exists()
    assert "No module named ensurepip" in caught.value.log
    assert lines[0].startswith("$ ")


def test_a_child_tells_its_lines_as_they_come_and_returns_its_output():
    lines = []
    code = "import sys; print('out'); print('one', file=sys.stderr); print('two', file=sys.stderr)"
    ended, output = child.run([PYTHON, "-c", code + "; sys.exit(3)"], on_line=lines.append)
    assert (ended, output.strip(), lines) == (3, "out", ["one", "two"])


def test_cancelling_ends_a_child_and_what_it_started(tmp_path):
    mark = tmp_path / "alive"
    inner = f"import time\nwhile True: open({str(mark)!r}, 'w').close(); time.sleep(0.05)"
    outer = (
        f"import subprocess, sys\nsubprocess.Popen([sys.executable, '-c', {inner!r}])\n"
        "import time; time.sleep(60)"
    )

    class EnoughError(Exception):
        pass

    def poll():
        if mark.exists():
            raise EnoughError

    with pytest.raises(EnoughError):
        child.run([PYTHON, "-c", outer], poll=poll)
    mark.unlink(missing_ok=True)
    time.sleep(0.4)
    assert not mark.exists()


def test_variables_that_qgis_sets_for_its_own_python_stay_with_it(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", "/nowhere")
    _, output = child.run([PYTHON, "-c", "import os; print(os.environ.get('PYTHONPATH'))"])
    assert output.strip() == "None"


def test_the_base_interpreter_is_one_of_the_running_version():
    assert child.base_python().name.startswith("python")


def test_an_audit_that_is_refused_is_told_in_its_own_sentence(tmp_path, monkeypatch):
    start = tmp_path / "start.py"
    start.write_text(
        f"import sys\nsys.path[:] = {sys.path!r}\n"
        "_, _, code, *sys.argv[1:] = sys.argv\nexec(code)\n"
    )
    monkeypatch.setattr(auditing, "interpreter", lambda _=None: (PYTHON, str(start)))
    (tmp_path / "project.toml").write_text("[project]\nid = 'a'\n")
    with pytest.raises(auditing.AuditError, match="reference"):
        auditing.run_audit(tmp_path / "project.toml")


def test_an_audit_that_breaks_down_is_told_with_its_last_line(tmp_path, monkeypatch):
    monkeypatch.setattr(auditing, "interpreter", lambda _=None: (PYTHON, "-c", "raise OSError(7)"))
    with pytest.raises(auditing.AuditError, match="code 1: OSError: 7"):
        auditing.run_audit(Path(tmp_path) / "project.toml")

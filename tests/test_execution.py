import json
import os
import signal
import subprocess
import sys
import time

import nbformat
import pytest
from nbformat.v4 import new_code_cell, new_notebook

pytest.importorskip("nbclient", reason="notebooks are executed with nbclient")

from trigpoint_reporting import execution
from trigpoint_reporting.execution import NotebookError, execute


def run(folder, *sources, **metadata):
    cells = [new_code_cell(source, id=f"c{k}") for k, source in enumerate(sources)]
    notebook = new_notebook(cells=cells, metadata=metadata)
    execute(notebook, folder)
    return notebook


def test_the_same_notebook_executed_twice_is_the_same_file(tmp_path):
    sources = (
        "import sys; print(hash('trigpoint')); sys.stderr.write('/home' + '/me/x.py: warning')",
        "import os; list({'north', 'east', 'south', 'west'}), os.path.basename(os.getcwd())",
    )
    one, other = (run(tmp_path, *sources, stated={"a": 1}) for _ in range(2))
    assert nbformat.writes(one) == nbformat.writes(other)
    assert one.metadata == {"stated": {"a": 1}}
    text = json.dumps(one)
    assert "/home/me" not in text
    assert '"execution":' not in text  # when each cell began and ended
    assert tmp_path.name in one.cells[1].outputs[0]["data"]["text/plain"]


def test_a_cell_that_fails_is_named_with_its_reason(tmp_path):
    with pytest.raises(NotebookError, match=r"A cell .* failed: ValueError: no such zone"):
        run(tmp_path, "1", "raise ValueError('no such zone')")


def test_a_kernel_that_dies_is_one_clear_error(tmp_path):
    with pytest.raises(NotebookError, match="kernel died"):
        run(tmp_path, "import os; os._exit(139)")


@pytest.mark.skipif(os.name == "nt", reason="Windows sends no SIGINT to a process")
def test_ctrl_c_while_a_cell_runs_is_a_stop_and_no_failure(tmp_path):
    code = (
        "import sys\n"
        "from nbformat.v4 import new_code_cell, new_notebook\n"
        "from pathlib import Path\n"
        "from trigpoint_reporting.execution import execute\n"
        'cell = \'import time; open("begun", "w").close(); time.sleep(30)\'\n'
        "try:\n"
        "    execute(new_notebook(cells=[new_code_cell(cell, id='c')]), Path(sys.argv[1]))\n"
        "except KeyboardInterrupt:\n"
        "    print('stopped')\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        while not (tmp_path / "begun").exists():
            assert process.poll() is None
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=20)[0] == "stopped\n"


def test_what_nbclient_finds_wrong_by_itself_is_no_stop(tmp_path, monkeypatch):
    def fail(*_, **__):
        raise AssertionError

    monkeypatch.setattr(execution.NotebookClient, "execute", fail)
    with pytest.raises(AssertionError):
        run(tmp_path, "1")


def test_what_users_set_for_themselves_stays_out(tmp_path, monkeypatch):
    startup = tmp_path / "home" / "profile_default" / "startup"
    startup.mkdir(parents=True)
    (startup / "00.py").write_text("mine = 1")
    rogue = tmp_path / "jupyter" / "kernels" / "python3"
    rogue.mkdir(parents=True)
    (rogue / "kernel.json").write_text(json.dumps({"argv": ["false"], "display_name": "x"}))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "home"))
    monkeypatch.setenv("JUPYTER_PATH", str(tmp_path / "jupyter"))
    monkeypatch.setenv("MPLBACKEND", "tkagg")
    notebook = run(tmp_path, "'mine' in globals()", "import os; os.environ['MPLBACKEND']")
    assert notebook.cells[0].outputs[0]["data"]["text/plain"] == "False"
    assert notebook.cells[1].outputs[0]["data"]["text/plain"] == "'agg'"


def test_a_notebook_can_execute_another(tmp_path):
    # Where a loop runs already, as in a tutorial.
    inner = (
        "from nbformat.v4 import new_code_cell, new_notebook\n"
        "from pathlib import Path\n"
        "from trigpoint_reporting.execution import execute\n"
        "notebook = new_notebook(cells=[new_code_cell('6 * 7', id='c')])\n"
        "execute(notebook, Path('.'))\n"
        "notebook.cells[0].outputs[0]['data']['text/plain']"
    )
    assert run(tmp_path, inner).cells[0].outputs[0]["data"]["text/plain"] == "'42'"


def test_no_kernel_is_left_running(tmp_path):
    psutil = pytest.importorskip("psutil", reason="psutil lists the processes")
    run(tmp_path, "1")
    with pytest.raises(NotebookError):
        run(tmp_path, "1 / 0")
    running = [p for p in psutil.Process().children() if p.status() != psutil.STATUS_ZOMBIE]
    assert not [p for p in running if "ipykernel_launcher" in str(p.cmdline())]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such sockets")
def test_no_port_of_the_machine_is_opened(tmp_path):
    source = (
        "import json, ipykernel; "
        "print(json.load(open(ipykernel.get_connection_file()))['transport'])"
    )
    assert run(tmp_path, source).cells[0].outputs[0]["text"] == "ipc\n"

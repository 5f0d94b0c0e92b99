"""Notebooks run in a clean kernel, and cleared of what differs from run to run."""

from __future__ import annotations

import asyncio
import os
import tempfile
from pathlib import Path

from jupyter_client.kernelspec import KernelSpecManager
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError, DeadKernelError
from nbformat import NotebookNode

from trigpoint.errors import TrigpointError

SECONDS = 600  # for one cell
# The same order of sets, no user's Matplotlib or IPython settings, no window.
ENVIRONMENT = {"PYTHONHASHSEED": "0", "MPLBACKEND": "agg", "PYDEVD_DISABLE_FILE_VALIDATION": "1"}


class NotebookError(TrigpointError, RuntimeError):
    """A cell of the report's notebook failed."""

    code = "notebook"


def execute(notebook: NotebookNode, folder: Path) -> None:
    """Execute a notebook in place, in a kernel of this very interpreter.

    Afterwards it holds no time, path or message of the machine: standard error, timings and what
    the kernel says about itself are dropped.

    Parameters
    ----------
    notebook : NotebookNode
    folder : Path
        The kernel's working folder.

    Raises
    ------
    NotebookError
        If a cell fails or the kernel dies; it names the cell.
    """
    with tempfile.TemporaryDirectory(prefix="trigpoint-") as private:
        # No kernel of the user's Jupyter folders: one that is called python3 may be another Python.
        specs = KernelSpecManager(kernel_dirs=[], ensure_native_kernel=True)
        kernel = AsyncKernelManager(
            kernel_name="python3",
            kernel_spec_manager=specs,
            connection_file=str(Path(private) / "kernel.json"),
            **_transport(private),
        )
        client = NotebookClient(
            notebook,
            km=kernel,
            timeout=SECONDS,
            record_timing=False,
            store_widget_state=False,
            resources={"metadata": {"path": str(folder)}},
        )
        stated = dict(notebook.metadata)
        log = Path(private) / "log"
        try:
            with log.open("wb") as said:
                client.execute(env=_environment(private), stderr=said, cleanup_kc=True)
        except (asyncio.CancelledError, AssertionError) as error:
            if not _is_interruption(error):
                raise
            raise KeyboardInterrupt from error
        except CellExecutionError as error:
            message = f"A cell of the notebook failed: {error.ename}: {error.evalue}"
            raise NotebookError(message) from error
        except DeadKernelError as error:
            last = log.read_text("utf-8", "replace").strip().rpartition("\n")[2]
            message = (
                f"The notebook's kernel died, perhaps for want of memory: {last or 'no word'}."
            )
            raise NotebookError(message) from error
    notebook.metadata.clear()  # of what the kernel says about itself
    notebook.metadata.update(stated)
    _scrub(notebook)


def _is_interruption(error: BaseException | None) -> bool:
    # Ctrl-C calls off the task that drives the kernel. Once the kernel has gone with it, cleaning
    # up after it fails as well, and that is what arrives.
    while error is not None and not isinstance(error, asyncio.CancelledError):
        error = error.__context__
    return error is not None


def _transport(private: str) -> dict[str, str]:
    """Sockets that only this user can open, where the system has them."""
    return {} if os.name == "nt" else {"transport": "ipc", "ip": f"{private}/kernel"}


def _environment(private: str) -> dict[str, str]:
    return {**os.environ, **ENVIRONMENT, "IPYTHONDIR": private}


def _scrub(notebook: NotebookNode) -> None:
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        if cell.cell_type == "code":
            cell.outputs = [
                output
                for output in cell.outputs
                if not (output.output_type == "stream" and output.name == "stderr")
            ]

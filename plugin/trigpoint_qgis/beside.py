"""Starts one of trigpoint's modules in another interpreter.

::

    beside.py [--packages FOLDER] -m MODULE ARGUMENT...

Run as a program by the environment's own Python, where the plugin's packages are not on the path.
"""

from __future__ import annotations

import os
import runpy
import sys
import warnings
from pathlib import Path


def main(arguments: list[str]) -> None:
    """Run a module, or code, as ``python -m`` and ``python -c`` do."""
    folders = [str(Path(__file__).resolve().parent / "_vendor")]
    if arguments[0] == "--packages":
        folders.append(arguments[1])
        arguments = arguments[2:]
    how, what, *rest = arguments
    # In place of this folder, whose modules are the plugin's.
    sys.path[:1] = folders
    # A report runs its notebook in a process of its own, which needs them too.
    os.environ["PYTHONPATH"] = os.pathsep.join(folders)
    # Debian's own Matplotlib leaves a part of itself in the way of a newer one; nothing needs it.
    warnings.filterwarnings("ignore", message="Unable to import Axes3D")
    sys.argv = [what, *rest]
    if how == "-m":
        runpy.run_module(what, run_name="__main__", alter_sys=True)
    elif how == "-c":
        exec(what, {"__name__": "__main__"})  # nosec B102
    else:
        sys.exit(f"beside.py: {how} is neither -m nor -c")


if __name__ == "__main__":
    main(sys.argv[1:])

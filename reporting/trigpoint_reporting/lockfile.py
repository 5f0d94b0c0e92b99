"""Which packages, source and machine made a bundle, as files that pip and people can read."""

from __future__ import annotations

import platform
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from trigpoint.canonical import to_json, write_text
from trigpoint_reporting.checkout import CHANGED, source_state

LOCK, SOURCE = "requirements.lock", "source.txt"


def write_lock(folder: Path) -> None:
    """Write ``requirements.lock``, for `pip install -r`, ``platform.json`` and ``source.txt``."""
    write_text(folder / LOCK, lock_text())
    write_text(folder / "platform.json", to_json(_platform()))
    write_text(folder / SOURCE, _source_text())


def is_of_here(folder: Path) -> bool:
    """Say whether the packages and the source that a folder states are known to run now.

    Which changes a changed checkout had is not stated: that two had the same is not known.
    """
    stated = [(folder / name).read_text("utf-8") for name in (LOCK, SOURCE)]
    return CHANGED not in stated[1] and stated == [lock_text(), _source_text()]


def lock_text() -> str:
    """Return what is installed here of what reports need, one package a line."""
    pins = installed_requirements("trigpoint", extras=("reporting",))
    return "".join(f"{name}=={pins[name]}\n" for name in pins)


def installed_requirements(name: str, *, extras: tuple[str, ...] = ()) -> dict[str, str]:
    """Return a distribution and all it requires, as far as installed: versions by name, sorted.

    Only what it requires: what else the environment holds is its user's own affair.

    Examples
    --------
    >>> sorted(installed_requirements("jsonschema"))[:2]
    ['attrs', 'jsonschema']
    """
    found: dict[str, str] = {}
    waiting = [(name, frozenset(extras))]
    seen = set()
    while waiting:
        current = waiting.pop()
        if current in seen:
            continue
        seen.add(current)
        try:
            distribution = metadata.distribution(current[0])
        except metadata.PackageNotFoundError:  # left out, as what is compiled may be
            continue
        found[canonicalize_name(distribution.metadata["Name"])] = distribution.version
        for line in distribution.requires or ():
            needed = Requirement(line)
            # What only another system, another Python or an extra not asked for requires may be
            # installed all the same, by something else: it is not of this bundle.
            if needed.marker is None or any(
                needed.marker.evaluate({"extra": extra}) for extra in ("", *current[1])
            ):
                waiting.append((needed.name, frozenset(needed.extras)))
    return dict(sorted(found.items()))


def _source_text() -> str:
    return f"{source_state()}\n"


def _platform() -> dict[str, Any]:
    libc, release = platform.libc_ver()
    return {
        "python": platform.python_version(),
        "implementation": platform.python_implementation(),
        "system": platform.system(),
        "machine": platform.machine(),
        "byte_order": sys.byteorder,
        "libc": f"{libc} {release}".strip(),
        "blas": _blas(),
    }


def _blas() -> str | None:
    # Its kernels decide the last bits. NumPy before 1.25 only prints it.
    try:
        built: Any = np.show_config(mode="dicts")  # type: ignore[call-arg,unused-ignore]
    except TypeError:
        return None
    blas = built["Build Dependencies"]["blas"]
    return f"{blas.get('name')} {blas.get('version')}"

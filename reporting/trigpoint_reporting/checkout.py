"""The git checkout that trigpoint runs from, where it does: its commit, and whether it changed."""

from __future__ import annotations

import os
import subprocess
import tomllib
from pathlib import Path

import trigpoint
import trigpoint_reporting

NOT_AVAILABLE = "not available"
PATIENCE_S = 60
CHANGED, UNCHANGED = "with local changes", "without local changes"


def source_state() -> str:
    """Say which commit runs, and whether files of it were changed; or that this is not available.

    Not available is what a wheel or the QGIS plugin gives, and a system without git.
    """
    root = own_root(Path(trigpoint.__file__), Path(trigpoint_reporting.__file__))
    return NOT_AVAILABLE if root is None else describe_checkout(root)


def own_root(core: Path, reporting: Path) -> Path | None:
    """Return the root of the checkout that these two packages belong to; None where they do not.

    A repository that only happens to be around them, such as a user's own with a virtual
    environment in it, says nothing about them: the root has to be a checkout of trigpoint, with
    both packages where trigpoint has them.

    Parameters
    ----------
    core, reporting : Path
        The ``__init__.py`` of `trigpoint` and of `trigpoint_reporting`.
    """
    packages = {"core": core, "reporting": reporting}
    try:
        root = core.resolve().parents[2]
        ours = all(
            path.resolve().parent == root / folder / path.resolve().parent.name
            for folder, path in packages.items()
        )
        if not ours or not (root / ".git").exists():
            return None
        stated = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))
        return root if stated["project"]["name"] == "trigpoint" else None
    except (OSError, ValueError, LookupError, TypeError):
        return None


def describe_checkout(root: Path) -> str:
    """Return a checkout's commit with or without local changes, as git tells it.

    Files that git does not track are no changes.
    """
    commit = _git(root, "rev-parse", "--verify", "HEAD")
    status = _git(root, "status", "--porcelain", "--untracked-files=no")
    if commit is None or status is None:
        return NOT_AVAILABLE
    return f"commit {commit}, {CHANGED if status else UNCHANGED}"


def _git(root: Path, *arguments: str) -> str | None:
    # Where git itself started us, as in a hook, these would lead it to another repository.
    environment = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")}
    environment["GIT_OPTIONAL_LOCKS"] = "0"  # to look is not to write
    # Another owner's checkout is refused lest it run code: here its code is running already.
    trusted = f"safe.directory={root.as_posix()}"
    try:
        done = subprocess.run(
            ["git", "-c", trusted, "-C", str(root), *arguments],
            capture_output=True,
            check=False,
            encoding="utf-8",
            env=environment,
            errors="replace",
            stdin=subprocess.DEVNULL,
            timeout=PATIENCE_S,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() if done.returncode == 0 else None

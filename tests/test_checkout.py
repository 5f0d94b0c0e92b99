import os
import shutil
import subprocess
from pathlib import Path

import pytest

import trigpoint
import trigpoint_reporting
from trigpoint_reporting import checkout
from trigpoint_reporting.checkout import describe_checkout, own_root, source_state

needs_git = pytest.mark.skipif(shutil.which("git") is None, reason="git is not installed")


def lay(root, *, name="trigpoint", git=True):
    """A checkout of trigpoint in outline; returns the files of its two packages."""
    packages = (root / "core" / "trigpoint", root / "reporting" / "trigpoint_reporting")
    for package in packages:
        package.mkdir(parents=True)
        (package / "__init__.py").write_text("", "utf-8")
    (root / "pyproject.toml").write_text(f'[project]\nname = "{name}"\n', "utf-8")
    if git:
        (root / ".git").mkdir()
    return tuple(package / "__init__.py" for package in packages)


def git(root, *arguments):
    identity = ("-c", "user.name=A", "-c", "user.email=a@b.c", "-c", "commit.gpgsign=false")
    subprocess.run(["git", *identity, "-C", root, *arguments], check=True, capture_output=True)


def test_a_checkout_of_trigpoint_is_known_by_its_project_file_and_packages(tmp_path):
    assert own_root(*lay(tmp_path / "a")) == (tmp_path / "a").resolve()
    assert own_root(*lay(tmp_path / "b", name="another")) is None
    assert own_root(*lay(tmp_path / "c", git=False)) is None
    broken = lay(tmp_path / "d")
    (tmp_path / "d" / "pyproject.toml").write_text("[", "utf-8")
    assert own_root(*broken) is None


def test_a_worktree_is_a_checkout_too(tmp_path):
    packages = lay(tmp_path, git=False)
    (tmp_path / ".git").write_text("gitdir: elsewhere", "utf-8")
    assert own_root(*packages) == tmp_path.resolve()


def test_a_users_own_repository_around_an_installed_trigpoint_does_not_count(tmp_path):
    lay(tmp_path)
    installed = tmp_path / ".venv" / "lib" / "python3" / "site-packages"
    packages = [installed / name / "__init__.py" for name in ("trigpoint", "trigpoint_reporting")]
    for path in packages:
        path.parent.mkdir(parents=True)
        path.write_text("", "utf-8")
    assert own_root(*packages) is None


def test_packages_of_two_checkouts_are_of_none(tmp_path):
    one, other = lay(tmp_path / "one"), lay(tmp_path / "other")
    assert own_root(one[0], other[1]) is None


@needs_git
def test_the_commit_is_stated_with_local_changes_and_without(tmp_path):
    lay(tmp_path, git=False)
    git(tmp_path, "init", "-q")
    assert describe_checkout(tmp_path) == "not available"  # no commit yet
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-q", "-m", "first")
    head = (tmp_path / ".git" / "HEAD").read_text("utf-8").split()[-1]
    commit = (tmp_path / ".git" / head).read_text("utf-8").strip()
    assert describe_checkout(tmp_path) == f"commit {commit}, without local changes"
    (tmp_path / "untracked.txt").write_text("", "utf-8")
    assert describe_checkout(tmp_path).endswith("without local changes")
    (tmp_path / "pyproject.toml").write_text("changed", "utf-8")
    assert describe_checkout(tmp_path) == f"commit {commit}, with local changes"


@needs_git
def test_the_repository_that_git_runs_a_hook_of_is_not_taken_for_ours(tmp_path, monkeypatch):
    for name in ("ours", "theirs"):
        lay(tmp_path / name, name=name, git=False)
        git(tmp_path / name, "init", "-q")
        git(tmp_path / name, "add", ".")
        git(tmp_path / name, "commit", "-q", "-m", name)
    plain = describe_checkout(tmp_path / "ours")
    monkeypatch.setenv("GIT_DIR", str(tmp_path / "theirs" / ".git"))
    assert describe_checkout(tmp_path / "ours") == plain


def test_without_git_or_with_one_that_hangs_nothing_is_stated(tmp_path, monkeypatch):
    lay(tmp_path)
    with monkeypatch.context() as patched:
        patched.setenv("PATH", str(tmp_path))
        assert describe_checkout(tmp_path) == "not available"

    def hang(*_, **options):
        raise subprocess.TimeoutExpired("git", options["timeout"])

    monkeypatch.setattr(checkout.subprocess, "run", hang)
    assert describe_checkout(tmp_path) == "not available"


def test_what_runs_here_is_stated_alike_each_time_and_without_a_path():
    told = source_state()
    assert told == source_state()
    assert os.sep not in told
    root = own_root(Path(trigpoint.__file__), Path(trigpoint_reporting.__file__))
    assert told.startswith("commit ") or told == "not available"
    assert root is not None or told == "not available"

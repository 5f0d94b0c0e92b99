import json
import sys
from importlib import metadata

import pytest

from trigpoint_reporting import lockfile
from trigpoint_reporting.lockfile import installed_requirements, is_of_here, write_lock


def test_the_lock_holds_what_is_required_and_nothing_else(tmp_path):
    write_lock(tmp_path)
    pins = dict(
        line.split("==") for line in (tmp_path / "requirements.lock").read_text("utf-8").split()
    )
    assert list(pins) == sorted(pins)
    assert pins["numpy"] == metadata.version("numpy")
    assert "lazrs" in pins  # by an extra of laspy
    assert "pytest" not in pins  # of ours that is not asked for


def test_an_extra_counts_only_where_it_is_asked_for():
    assert "jinja2" not in installed_requirements("trigpoint")
    assert installed_requirements("no-such-distribution") == {}


def test_what_only_another_system_or_python_requires_is_not_of_the_lock():
    # IPython requires colorama on Windows alone; other packages bring it here, or do not.
    named = [line for line in metadata.requires("ipython") or () if line.startswith("colorama")]
    assert named
    pins = installed_requirements("trigpoint", extras=("reporting",))
    assert "ipython" in pins
    assert ("colorama" in pins) == (sys.platform == "win32")


def test_the_platform_states_no_path_or_host(tmp_path):
    write_lock(tmp_path)
    told = json.loads((tmp_path / "platform.json").read_text("utf-8"))
    assert set(told) == {
        "python",
        "implementation",
        "system",
        "machine",
        "byte_order",
        "libc",
        "blas",
    }
    assert "/" not in "".join(str(value) for value in told.values())


@pytest.mark.parametrize(
    ("told", "known"),
    [
        ("commit abc, without local changes", True),
        ("not available", True),  # a wheel: its version is in the lock
        ("commit abc, with local changes", False),
    ],
)
def test_of_a_changed_checkout_it_is_not_known_that_it_is_the_same(
    tmp_path, monkeypatch, told, known
):
    monkeypatch.setattr(lockfile, "source_state", lambda: told)
    write_lock(tmp_path)
    assert is_of_here(tmp_path) is known
    monkeypatch.setattr(lockfile, "source_state", lambda: "commit def, without local changes")
    assert not is_of_here(tmp_path)

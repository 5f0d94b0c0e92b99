import os

import pytest

from trigpoint_panel.ownership import is_owned, own


def test_one_window_at_a_time_keeps_an_autosave_and_leaves_no_lock(tmp_path):
    autosave = tmp_path / "a.trig.json~"
    assert not is_owned(autosave)
    first = own(autosave)
    assert is_owned(autosave)
    assert own(autosave) is None
    first.release()
    assert not is_owned(autosave)
    assert list(tmp_path.iterdir()) == []
    again = own(autosave)
    assert is_owned(autosave)
    again.release()


def test_the_lock_of_a_window_that_died_stands_in_nobodys_way(tmp_path):
    autosave = tmp_path / "a.trig.json~"
    (tmp_path / "a.trig.json~.lock").touch()  # as a crash leaves it
    assert not is_owned(autosave)
    own(autosave).release()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.name != "posix", reason="Windows removes no file that is open")
def test_a_lock_that_was_removed_while_it_was_waited_for_is_taken_anew(tmp_path, monkeypatch):
    autosave, lock = tmp_path / "a.trig.json~", tmp_path / "a.trig.json~.lock"
    opened, open_ = [], os.open

    def slow(path, *given):
        handle = open_(path, *given)
        if not opened:
            lock.unlink()  # its former owner goes, just now
        opened.append(handle)
        return handle

    monkeypatch.setattr(os, "open", slow)
    owned = own(autosave)
    assert len(opened) == 2
    assert is_owned(autosave)
    owned.release()


def test_where_nothing_can_be_written_nobody_is_kept_out(tmp_path):
    nowhere = tmp_path / "gone" / "a.trig.json~"
    own(nowhere).release()
    assert not is_owned(nowhere)

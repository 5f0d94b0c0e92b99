import shutil
import subprocess

import pytest

from trigpoint_reporting.manifest import (
    BundleError,
    hash_files,
    is_inside,
    list_files,
    read_manifest,
    write_manifest,
)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "ä.txt").write_text("one", "utf-8")
    (tmp_path / "a.txt").write_text("two", "utf-8")
    return tmp_path


def test_a_manifest_reads_back_and_is_sorted(folder):
    hashes = hash_files(folder)
    assert list(hashes) == ["a.txt", "b/ä.txt"]
    write_manifest(folder / "manifest", dict(reversed(hashes.items())))
    assert read_manifest(folder / "manifest") == hashes
    assert list_files(folder) == ["a.txt", "b/ä.txt", "manifest"]


@pytest.mark.skipif(shutil.which("sha256sum") is None, reason="this system has no sha256sum")
def test_sha256sum_checks_it_without_python(folder):
    write_manifest(folder / "manifest", hash_files(folder))
    check = ["sha256sum", "-c", "--strict", "manifest"]
    assert subprocess.run(check, cwd=folder, capture_output=True, check=False).returncode == 0
    (folder / "a.txt").write_text("twx", "utf-8")
    assert subprocess.run(check, cwd=folder, capture_output=True, check=False).returncode == 1


@pytest.mark.parametrize(
    "line",
    [
        "abc  a.txt",
        f"{'A' * 64}  a.txt",
        f"{'a' * 64}  ../a.txt",
        f"{'a' * 64}  /etc/passwd",
        f"{'a' * 64}  b//a.txt",
        f"{'a' * 64}  C:\\a.txt",
        f"{'a' * 64}  x\n{'a' * 64}  x",
        "",
    ],
)
def test_a_line_that_is_no_hash_and_path_is_refused(tmp_path, line):
    (tmp_path / "m").write_text(f"{line}\n", "utf-8")
    with pytest.raises(BundleError, match="line"):
        read_manifest(tmp_path / "m")


def test_what_is_missing_or_no_text_is_refused(tmp_path):
    (tmp_path / "m").write_bytes(b"\xff\xfe")
    for name in ("m", "none"):
        with pytest.raises(BundleError, match="missing or is not"):
            read_manifest(tmp_path / name)


def test_paths_that_any_system_would_leave_the_folder_by_are_told():
    assert is_inside("data/results.json")
    for name in ("", "/a", "a/", "a//b", "./a", "a/../b", "..", "a\\b", "c:a", "a\nb", "a\0b"):
        assert not is_inside(name)

import stat
import zipfile

import pytest

from trigpoint_reporting.manifest import BundleError
from trigpoint_reporting.unpacking import opened


@pytest.fixture
def packed(tmp_path):
    """Make a zip of the given names and contents."""

    def make(entries):
        path = tmp_path / "bundle.zip"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in entries:
                archive.writestr(name, content)
        return path

    return make


def refused(path, match):
    with pytest.raises(BundleError, match=match), opened(path):
        pass


def test_a_folder_is_opened_as_it_lies_and_a_zip_for_a_while(tmp_path, packed):
    with opened(tmp_path) as folder:
        assert folder == tmp_path
    with opened(packed([("a-r1/data/x.txt", "x"), ("a-r1/y", "y")])) as folder:
        assert folder.name == "a-r1"
        assert (folder / "data" / "x.txt").read_text() == "x"
    assert not folder.exists()


@pytest.mark.parametrize(
    "name", ["../out", "a/../../out", "/etc/out", "a\\..\\..\\out", "a/C:/out", "a//out", "a/./out"]
)
def test_a_path_that_leaves_the_folder_is_refused(packed, tmp_path, name):
    path = packed([("a/x", "x"), (name, "x")])
    refused(path, "it is not unpacked")
    assert not (tmp_path / "out").exists()


def test_a_link_is_refused(packed):
    link = zipfile.ZipInfo("a/link")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    refused(packed([("a/x", "x"), (link, "/etc/passwd")]), "link or a device")


def test_a_bomb_is_refused_before_it_goes_off(packed):
    refused(packed([("a/bomb", bytes(50_000_000))]), r"would unpack to 1 files of 50,000,000 bytes")
    refused(packed([(f"a/{k}", "") for k in range(10_001)]), "10,001 files")


def test_more_or_less_than_one_folder_is_refused(packed):
    refused(packed([]), "0 things at its top")
    refused(packed([("a/x", "x"), ("b/x", "x")]), "2 things at its top")
    refused(packed([("x", "x")]), "one folder")


def test_a_name_twice_is_refused(packed):
    refused(packed([("a/x", "x"), ("a/X", "y")]), "a name twice")


def test_what_is_no_zip_is_refused(tmp_path, packed):
    path = tmp_path / "no.zip"
    path.write_bytes(b"PK\x03\x04 but no zip")
    refused(path, "no zip that can be read")
    refused(tmp_path / "none.zip", "no such bundle")
    whole = packed([("a/x", b"text " * 1000)])
    content = bytearray(whole.read_bytes())
    content[40:60] = bytes(20)
    whole.write_bytes(content)
    refused(whole, "no zip that can be read")

import json
from fnmatch import fnmatchcase
from importlib.resources import files

import laspy
import pytest
from bundles import sealed_bundle

from trigpoint.files import SIGMAS
from trigpoint_reporting.dictionary import FILES, NAMES, describe_file
from trigpoint_reporting.manifest import RECORD, list_files, read_manifest
from trigpoint_reporting.readme import LATER, README, SCHEMA, names_in
from trigpoint_reporting.verification import verify

BUILT = {}


@pytest.fixture
def bundle(small_project, tmp_path_factory):
    """A bundle with all that one may hold: check and repeated picks, sigmas, ICP, a revision."""
    if not BUILT:
        path, _ = small_project(
            tmp_path_factory.mktemp("made") / "small", extra="[alignment]\nsigma = true\n"
        )
        again = path.with_name("again.csv")
        lines = (path.with_name("picks.csv")).read_text("utf-8").splitlines()
        columns = lines[0].split(",")
        moved = [lines[0]]
        for k, line in enumerate(lines[1:]):
            cells = line.split(",")
            for axis in ("source_x", "target_x"):
                at = columns.index(axis)
                cells[at] = repr(float(cells[at]) + 0.003 * (-1) ** k)
            moved.append(",".join(cells))
        again.write_text("\n".join(moved) + "\n", "utf-8")
        sealed_bundle(path)
        text = path.read_text("utf-8")
        text = text.replace("title =", "revision = 2\ntitle =").replace(
            'picks = "picks.csv"', 'picks = "picks.csv"\npicks_repeated = ["again.csv"]'
        )
        path.write_text(text, "utf-8")

        def report(draft, _):
            (draft / "figures").mkdir()
            for name in ("report.html", "report.pdf", "audit.ipynb", "audit.py", "figures/a.svg"):
                (draft / name).write_text("later", "utf-8")

        BUILT["folder"] = sealed_bundle(path, report)
    return BUILT["folder"]


def sections_of(folder):
    """The lines of README.txt by the title above them."""
    lines = (folder / README).read_text("ascii").splitlines()
    found, title = {}, None
    for k, line in enumerate(lines):
        if k + 1 < len(lines) and line and set(lines[k + 1]) in ({"-"}, {"="}):
            title = line
            found[title] = []
        elif title and line and set(line) not in ({"-"}, {"="}):
            found[title].append(line)
    return found


def named(path):
    """What `names_in` finds but for the dimensions that every LAS file has."""
    if path.suffix != ".laz":
        return names_in(path)
    with laspy.open(path) as file:
        extra = list(file.header.point_format.extra_dimension_names)
    assert set(extra) <= set(names_in(path))
    return extra


def test_every_file_of_a_bundle_is_described_and_no_other(bundle):
    names = list_files(bundle)
    assert [name for name in names if not describe_file(name)] == []
    for pattern in FILES:
        assert any(fnmatchcase(name, pattern) for name in names), pattern
    assert describe_file("data/other.csv") == ""


def test_every_column_key_and_extra_dimension_is_described_and_no_other(bundle):
    names = list_files(bundle)
    for pattern, meanings in NAMES.items():
        found = {
            key for name in names if fnmatchcase(name, pattern) for key in named(bundle / name)
        }
        if pattern.endswith("-georeferenced.laz"):
            found &= set(SIGMAS)  # the rest is what the user's cloud holds
        assert found == set(meanings), pattern
        assert all(meanings.values())
    tables = [name for name in names if name.startswith("data/") and name[-4:] in (".csv", ".npz")]
    for name in tables:
        assert any(fnmatchcase(name, pattern) for pattern in NAMES), name


def test_the_readme_has_a_line_for_every_file_and_every_name_in_them(bundle):
    sections = sections_of(bundle)
    listed = [line.split("  ")[0] for line in sections["Files"]]
    present = set(list_files(bundle))
    made_later = {name for name in present if any(fnmatchcase(name, each) for each in LATER)}
    for name in present - made_later:
        assert name in listed, name
    assert set(listed) - present - set(LATER) == {
        "Made from these afterwards, the first five where a report could be made:"
    }
    for pattern, meanings in NAMES.items():
        lines = sections[pattern.replace("*", "NAME")]
        assert [line.split()[0] for line in lines] == list(meanings)


def test_the_readme_describes_only_what_this_bundle_holds(small_project):
    path, _ = small_project(extra="icp = false\n")
    folder = sealed_bundle(path)
    text = (folder / README).read_text("ascii")
    for absent in ("after_icp_accuracy_m", "distance_after_icp_m", "repeats", "changes.json"):
        assert absent not in text
    assert "sigma_e" not in text
    assert "distance_m " in text
    assert verify(folder).holds


def test_the_readme_and_the_schema_belong_to_the_record_and_the_crate(bundle):
    recorded = read_manifest(bundle / RECORD)
    assert {README, SCHEMA, "env/source.txt"} <= set(recorded)
    own = files("trigpoint").joinpath("results.schema.json").read_bytes()
    assert (bundle / SCHEMA).read_bytes() == own
    crate = json.loads((bundle / "ro-crate-metadata.json").read_text("utf-8"))
    graph = {each["@id"]: each for each in crate["@graph"]}
    assert graph[README]["encodingFormat"] == "text/plain"
    assert graph["data/results.json"]["conformsTo"] == {"@id": SCHEMA}
    for name in recorded:
        assert graph[name]["description"] == describe_file(name)

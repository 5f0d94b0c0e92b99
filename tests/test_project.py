import datetime as dt
import tomllib

import pytest

from trigpoint.errors import ProjectError
from trigpoint.project import project_from, read_project

WHOLE = """
[project]
id = "tower"
title = "Clock tower"
status = "issued"
revision = 2
date = 2026-09-21
[reference]
path = "lidar.laz"
crs = "EPSG:32615"
accuracy_m = 0.05
region = "plan.geojson"
[[reconstruction]]
name = "nerf"
path = "clouds/nerf.ply"
picks = "picks.csv"
[[reconstruction]]
name = "sfm"
kind = "photogrammetry"
path = "/data/sfm.laz"
[alignment]
threshold_m = 1
[comparison]
margin_m = "none"
zones = [0.5]
[[cross_check]]
kind = "scale_bar"
from = [0, 0, 0]
to = [1, 0, 0]
length_m = 3.2
sigma_m = 0.005
[[limit]]
quantity = "loocv.rmse_m"
of = "nerf"
max = 0.25
source = "brief, clause 4"
"""


@pytest.fixture
def written(tmp_path):
    def write(text):
        path = tmp_path / "project.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_a_whole_project_is_read(written, tmp_path):
    project = read_project(written(WHOLE))
    assert project.about.date == dt.date(2026, 9, 21)
    assert project.reference.path == tmp_path / "lidar.laz"
    assert project.reference.region == tmp_path / "plan.geojson"
    nerf, sfm = project.reconstructions
    assert (nerf.kind, nerf.picks) == ("neural", tmp_path / "picks.csv")
    assert (str(sfm.path), sfm.picks) == ("/data/sfm.laz", None)
    assert project.alignment.threshold_m == 1.0
    assert project.alignment.seed == 42
    assert project.comparison.margin_m is None
    assert project.comparison.zones == (0.5,)
    assert project.cross_checks[0].length_m == 3.2
    assert project.limits[0].max == 0.25


def test_what_is_left_out_has_the_documented_defaults(written):
    project = read_project(
        written(
            '[project]\nid="a"\n[reference]\npath="r.laz"\n[[reconstruction]]\nname="n"\npath="n.ply"\n'
        )
    )
    assert project.alignment.method == "ransac"
    assert (project.alignment.threshold_m, project.alignment.trials) == (0.50, 10_000)
    assert project.comparison.within_m == (0.05, 0.10, 0.20)
    assert project.comparison.zones == (0.33, 0.66)
    assert project.comparison.margin_m == 1.0


BAR = 'kind = "scale_bar"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nlength_m = 3.2\nsigma_m = 0.005'
REFUSED = {
    "an unknown key, with the nearest known one": (
        "threshold_m = 1",
        "treshold_m = 1",
        "mean 'threshold_m'",
    ),
    "an unknown table": ("[alignment]", "[alignement]", "mean 'alignment'"),
    "a missing key": ('path = "lidar.laz"\n', "", r"\[reference\] lacks 'path'"),
    "a number as text": ("accuracy_m = 0.05", 'accuracy_m = "0.05"', "must be a finite number"),
    "a truth value as a number": (
        "accuracy_m = 0.05",
        "accuracy_m = true",
        "must be a finite number",
    ),
    "a number that is not finite": (
        "accuracy_m = 0.05",
        "accuracy_m = nan",
        "must be a finite number",
    ),
    "zero where it makes no sense": ("threshold_m = 1", "threshold_m = 0", "must be above 0"),
    "a fraction of a trial": ("threshold_m = 1", "trials = 1.5", "must be a whole number"),
    "zones that fall": (
        "zones = [0.5]",
        "zones = [0.66, 0.33]",
        "fractions between 0 and 1 that rise",
    ),
    "a zone at the top": ("zones = [0.5]", "zones = [1.0]", "fractions between 0 and 1 that rise"),
    "an unknown kind": ('"photogrammetry"', '"lidar"', "one of neural, photogrammetry"),
    "an unknown cross check": ('"scale_bar"', '"yardstick"', "one of scale_bar, up_direction"),
    "a scale bar of two numbers": ("to = [1, 0, 0]", "to = [1, 0]", "three numbers"),
    "a scale bar that starts nowhere": (
        "from = [0, 0, 0]",
        "from = [0, 0]",
        r"\[cross_check\] from is",
    ),
    "a scale bar without a start": ("from = [0, 0, 0]\n", "", "lacks 'from'"),
    "a scale bar of no length": ("to = [1, 0, 0]", "to = [0, 0, 0]", "another point"),
    "picks repeated without picks": (
        'picks = "picks.csv"',
        'picks_repeated = ["again.csv"]',
        "has picks_repeated and no picks",
    ),
    "picks repeated that are no list": (
        'picks = "picks.csv"',
        'picks = "picks.csv"\npicks_repeated = "again.csv"',
        "a list of paths",
    ),
    "a vertical of no length": (
        BAR,
        'kind = "up_direction"\nup = [0, 0, 0]\nsigma_deg = 1',
        "a direction: not zero",
    ),
    "cameras that were not all measured": (
        BAR,
        'kind = "camera_positions"\nsource = [[0, 0, 0], [1, 0, 0]]\n'
        "target_m = [[0, 0, 0]]\nsigma_m = 0.1",
        "the same cameras",
    ),
    "a limit on nothing known": ('of = "nerf"', 'of = "nurf"', "one of nerf, sfm"),
    "a limit both ways": ("max = 0.25", "max = 0.25\nmin = 0.1", "either 'max' or 'min'"),
    "a limit neither way": ("max = 0.25\n", "", "either 'max' or 'min'"),
    "two reconstructions of one name": ('name = "sfm"', 'name = "nerf"', "names must differ"),
    "a name that no file can have": ('id = "tower"', 'id = "../tower"', "starts with a letter"),
    "an issue without a date": ("date = 2026-09-21\n", "", "states its date"),
    "a date in quotes": ("date = 2026-09-21", 'date = "2026-09-21"', "without quotes"),
    "a path that climbs out": ('"lidar.laz"', '"../lidar.laz"', "leaves the project's folder"),
    "a path that climbs out in Windows' way": (
        '"lidar.laz"',
        "'..\\lidar.laz'",
        "leaves the project's folder",
    ),
    "an empty path": ('"lidar.laz"', '""', "path of a file"),
    "a path with a NUL": ('"lidar.laz"', '"a\\u0000b"', "without NUL"),
    "brackets without end": ("[alignment]", f"a = {5000 * '['}\n[alignment]", "too deep"),
    "a number of 5000 digits": ("threshold_m = 1", f"trials = {5000 * '1'}", "it holds a number"),
    "a number beyond every float": ("threshold_m = 1", f"threshold_m = {'9' * 400}", "a finite"),
    "a hexadecimal without end": ("threshold_m = 1", f"trials = 0x{'f' * 5000}", "at most"),
    "more trials than fit": ("threshold_m = 1", "trials = 10_000_001", "at most 10,000,000"),
    "a seed beyond 63 bits": ("threshold_m = 1", "seed = 9223372036854775808", "at most 9,223"),
    "a threshold twice": (
        "zones = [0.5]",
        "within_m = [0.1, 0.2, 0.1]",
        r"within_m is \[0\.1, 0\.2, 0\.1\]; it must be thresholds that differ",
    ),
    "an id too long": ('id = "tower"', f'id = "{101 * "a"}"', "at most 100 characters, not 101"),
    "a name too long": ('name = "sfm"', f'name = "{101 * "a"}"', "at most 100 characters"),
    "text that is not TOML": ("[alignment]", "[alignment", "not valid TOML"),
    "one table where several may stand": ("[[limit]]", "[limit]", r"written \[\[limit\]\]"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refuses(case, written):
    old, new, words = REFUSED[case]
    assert old in WHOLE
    with pytest.raises(ProjectError, match=words) as caught:
        read_project(written(WHOLE.replace(old, new, 1)))
    assert len(str(caught.value)) < 300


def test_a_link_does_not_lead_out_of_the_folder(written, tmp_path):
    (tmp_path / "clouds").symlink_to("/")
    with pytest.raises(ProjectError, match="leaves the project's folder"):
        read_project(written(WHOLE))


def test_a_missing_file_is_one_clear_error(tmp_path):
    with pytest.raises(ProjectError, match=r"project\.toml can't be read"):
        read_project(tmp_path / "project.toml")


def test_tables_that_were_never_a_file_are_checked_alike(tmp_path):
    tables = tomllib.loads(WHOLE)
    (tmp_path / "project.toml").write_text(WHOLE)
    made = project_from(tables, tmp_path / "project.toml")
    assert made == read_project(tmp_path / "project.toml")
    with pytest.raises(ProjectError, match=r"\[alignment\] threshold_m"):
        project_from(tables | {"alignment": {"threshold_m": 0}}, tmp_path / "project.toml")

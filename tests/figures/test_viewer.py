import base64
import json
import re
import shutil
import subprocess
import zlib
from html.parser import HTMLParser

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from trigpoint_reporting.elevations import colour_table
from trigpoint_reporting.evidence import Evidence
from trigpoint_reporting.viewer import MOST, pack, viewer_html

CHROMIUM = (
    shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
)
HOSTILE = '"><script>alert(1)</script>'


def unpack(text, count):
    """What the browser does, in another language."""
    planes = np.frombuffer(zlib.decompress(base64.b64decode(text)), np.uint8).reshape(-1, count)
    folded = planes[0:6:2].astype(np.int64) | planes[1:6:2].astype(np.int64) << 8
    steps = np.where(folded & 1, -(folded + 1) // 2, folded // 2)
    return steps.cumsum(axis=1).T, list(planes[6:])


@given(arrays(np.int64, st.tuples(st.integers(1, 30), st.just(3)), elements=st.integers(0, 32_000)))
def test_what_is_packed_is_unpacked_the_same(cells):
    bands = np.arange(len(cells)).astype(np.uint8)
    back, scalars = unpack(pack(cells, [bands, bands[::-1]]), len(cells))
    np.testing.assert_array_equal(back, cells)
    np.testing.assert_array_equal(scalars, [bands, bands[::-1]])


def test_a_step_too_large_to_pack_is_refused():
    with pytest.raises(ValueError, match="does not fit two bytes"):
        pack(np.array([[0, 0, 0], [40_000, 0, 0]]), [])


class Page(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.tags, self.scripts, self.inside = [], [], None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        self.inside = dict(attrs) if tag == "script" else None
        if tag == "script":
            self.scripts.append([self.inside, ""])

    def handle_endtag(self, _):
        self.inside = None

    def handle_data(self, data):
        if self.inside is not None:
            self.scripts[-1][1] += data


def test_the_viewer_loads_nothing_and_is_the_same_bytes(evidence):
    text = viewer_html(evidence)
    assert viewer_html(evidence) == text
    assert "http" not in text
    for _, attributes in Page(text).tags:
        assert not {"src", "href"} & set(attributes)
    assert len(text) < 600_000


def test_the_data_are_the_clouds_to_a_fifth_of_a_voxel(evidence):
    scripts = Page(viewer_html(evidence)).scripts
    scene = json.loads(next(text for kind, text in scripts if kind.get("class") == "scene"))
    packed = [text for kind, text in scripts if kind.get("class") == "packed"]
    assert scene["step"] == pytest.approx(0.04)
    assert len(packed) == len(scene["counts"]) == 3
    assert sum(scene["counts"]) <= MOST
    assert scene["colours"] == colour_table().tolist()
    assert len(scene["layers"]) == 4
    stored = evidence.distances("nerf")
    cells, scalars = unpack(packed[0], scene["counts"][0])
    heights = stored["delivered_accuracy_height_m"]
    assert len(cells) == len(heights)  # few enough to keep all
    spread = scene["step"] * np.ptp(cells[:, 2])
    assert spread == pytest.approx(np.ptp(heights), abs=0.05)
    assert ((scalars[0] < 2) == (stored["delivered_accuracy_m"] <= 0.1)).all()


def test_names_are_data(evidence, tmp_path):
    results = json.loads(json.dumps(evidence.results))
    reconstructions = results["reconstructions"]
    reconstructions[HOSTILE] = reconstructions.pop("nerf")
    folder = tmp_path / "hostile"
    shutil.copytree(evidence.folder, folder)

    for name in ("accuracy", "completeness"):
        target = folder / "clouds" / f"{HOSTILE}-{name}.laz"
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(folder / "clouds" / f"nerf-{name}.laz", target)
    text = viewer_html(Evidence(folder, results))
    assert "alert(1)</script>" not in text
    assert sum(tag == "script" for tag, _ in Page(text).tags) == 5


def test_readers_without_script_are_told_and_every_control_has_a_name(evidence):
    page = Page(viewer_html(evidence))
    canvas = next(attributes for tag, attributes in page.tags if tag == "canvas")
    assert canvas["tabindex"] == "0"
    assert "arrow keys" in canvas["aria-label"]
    stage = next(a for tag, a in page.tags if tag == "div" and a.get("class") == "stage")
    assert "hidden" in stage  # until the script has drawn
    assert "needs a browser with JavaScript" in viewer_html(evidence)
    assert sum(tag == "button" for tag, _ in page.tags) == 7


@pytest.fixture
def browsed(evidence, tmp_path):
    """Open the viewer in a browser, do something, and return the page as it is then."""
    if CHROMIUM is None:
        pytest.skip("there is no Chromium to open the viewer in")

    def make(script=""):
        page = tmp_path / "page.html"
        page.write_text(
            f"<!doctype html><html lang='en'><meta charset='utf-8'><body>{viewer_html(evidence)}"
            f"<script>{script}</script>",
            "utf-8",
        )
        options = ["--headless", "--no-sandbox", "--use-angle=swiftshader"]
        options += ["--enable-unsafe-swiftshader", "--virtual-time-budget=6000"]
        done = subprocess.run(
            [
                CHROMIUM,
                *options,
                f"--user-data-dir={tmp_path}/profile",
                "--dump-dom",
                page.as_uri(),
            ],
            capture_output=True,
            text=True,
            timeout=120,
            check=True,
        )
        return done.stdout

    return make


WHEN_DRAWN = """
const canvas = document.querySelector("canvas");
const timer = setInterval(() => {
  if (!canvas.dataset.drawn) return;
  clearInterval(timer);
  %s
}, 50);
"""
LOOK = """
  const pixels = new Uint8Array(4 * canvas.width * canvas.height);
  const gl = canvas.getContext("webgl2");
  gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  const seen = new Set();
  for (let i = 0; i < pixels.length; i += 4) seen.add([...pixels.slice(i, i + 3)].join());
  document.body.dataset.colours = [...seen].join(" ");
  document.body.dataset.before = canvas.dataset.eye;
  canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
  document.querySelector("[data-act=near]").click();
  const other = document.querySelectorAll("input[type=radio]")[2];
  other.checked = true;
  other.dispatchEvent(new Event("change", { bubbles: true }));
"""


def test_a_browser_draws_the_legends_colours_and_turns_by_keyboard(evidence, browsed):
    dom = browsed(WHEN_DRAWN % LOOK)
    canvas = dict(re.findall(r'data-(\w+)="([^"]*)"', dom[dom.index("<canvas") :]))
    body = dict(re.findall(r'data-(\w+)="([^"]*)"', dom[dom.index("<body") : dom.index("<figure")]))
    colours = {tuple(map(int, each.split(","))) for each in body["colours"].split(" ")}
    allowed = {tuple(colour) for colour in colour_table().tolist()} | {(255, 255, 255)}
    assert len(colours) > 5
    assert colours <= allowed
    before, after = (np.array(text.split(" "), float) for text in (body["before"], canvas["eye"]))
    assert after[0] - before[0] == pytest.approx(0.15, abs=2e-3)
    assert after[2] / before[2] == pytest.approx(0.85, abs=2e-3)
    counts = evidence.results["reconstructions"]["nerf"]["comparison"]["delivered"]["counts"]
    assert int(canvas["drawn"]) == counts["reference_voxels"]

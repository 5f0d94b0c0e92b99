import json
from html.parser import HTMLParser

import pytest

from trigpoint_reporting.batch import write_index

HOSTILE = '"><script>alert(1)</script><img src=x onerror=alert(1)> \u202eabc'


@pytest.fixture
def bundle(tmp_path):
    """Lay down what an index reads of a bundle."""

    def make(name, verdict="PASS", *, report=True, title="", criteria=(), loocv=0.2):
        folder = tmp_path / "out" / f"{name}-r1"
        (folder / "data").mkdir(parents=True)
        results = {
            "project": {
                "id": name,
                "revision": 1,
                "title": title,
                "site": title,
                "status": "issued",
                "date": "2026-09-21",
            },
            "reconstructions": {
                "nerf": {
                    "alignment": {"n": 6, "outliers": ["a"], "rmse_m": 0.1374},
                    "loocv": {"rmse_m": loocv},
                },
                "sfm": {"alignment": None, "loocv": None},
            },
            "criteria": [{"met": met} for met in criteria],
            "verdict": verdict,
            "warnings": [{}, {}],
        }
        (folder / "data" / "results.json").write_text(json.dumps(results), "utf-8")
        if report:
            (folder / "report.html").write_text("", "utf-8")
        return folder

    return make


class Page(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.tags, self.words = [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.words.append(data)


def read(path):
    page = Page(path.read_text("utf-8"))
    return page, " ".join(" ".join(page.words).split())


def test_every_project_has_its_row_its_verdict_and_its_link(bundle, tmp_path):
    bundles = [
        bundle("tower", "FAIL", criteria=[True, False]),
        bundle("mill", "NOT TESTED", report=False, loocv=None),
    ]
    path = tmp_path / "out" / "index.html"
    write_index(path, bundles)
    page, text = read(path)
    assert "2 projects: 1 FAIL, 1 NOT TESTED." in text
    assert "tower r1 issued, 2026-09-21 ✗ FAIL 1 of 2 nerf 6 of 7 0.137 0.200 2" in text
    assert "mill r1 issued, 2026-09-21 ○ NOT TESTED none stated nerf 6 of 7 0.137" in text
    assert "not available" in text
    assert "None" not in text
    links = [attrs["href"] for tag, attrs in page.tags if tag == "a"]
    assert links == ["tower-r1/report.html"]


def test_what_projects_say_is_text(bundle, tmp_path):
    path = tmp_path / "out" / "index.html"
    write_index(path, [bundle("tower", title=HOSTILE)])
    page, text = read(path)
    assert not {"script", "img"} & {tag for tag, _ in page.tags}
    assert "alert(1)" in text
    assert sum(tag == "bdi" for tag, _ in page.tags) == 3


def test_it_stands_alone_and_can_be_read_by_everyone(bundle, tmp_path):
    path = tmp_path / "out" / "index.html"
    write_index(path, [bundle("tower")])
    page, _ = read(path)
    tags = [tag for tag, _ in page.tags]
    assert dict(page.tags)["html"]["lang"] == "en"
    assert tags.count("h1") == tags.count("caption") == 1
    assert all(attrs.get("scope") for tag, attrs in page.tags if tag == "th")
    assert "http" not in path.read_text("utf-8")
    assert "src" not in {name for _, attrs in page.tags for name in attrs}


def test_the_same_bundles_give_the_same_bytes(bundle, tmp_path):
    bundles = [bundle("tower"), bundle("mill")]
    write_index(tmp_path / "one.html", bundles)
    write_index(tmp_path / "two.html", bundles)
    assert (tmp_path / "one.html").read_bytes() == (tmp_path / "two.html").read_bytes()

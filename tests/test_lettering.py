"""Letters that were joined look as they did one by one."""

import re
import shutil
import subprocess

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="figures need matplotlib")

from trigpoint_reporting.lettering import join_letters, join_letters_in
from trigpoint_reporting.style import canvas, to_svg


@pytest.fixture
def svg():
    with canvas(60) as figure:
        axes = figure.subplots()
        axes.plot([0, 1, 2], [-1.5, 3, 2.25], "o-", label="Ω “name” & <b>")
        axes.set_ylabel("turned, metres")
        axes.set_title("0123456789 é", fontweight="bold")
        figure.legend()
        return to_svg(figure).decode("utf-8")


def test_each_line_is_one_path_and_marks_stay(svg):
    joined = join_letters(svg)
    letters = re.compile(r'xlink:href="#DejaVu')
    assert letters.search(svg)
    assert not letters.search(joined)
    marks = re.compile(r"<use [^>]* x=")
    assert len(marks.findall(joined)) == len(marks.findall(svg)) > 0
    assert join_letters(joined) == joined


def test_a_page_keeps_all_but_its_svg():
    page = '<img src="data:image/png;base64,AAAA"><p>src= <use xlink:href="#a"/></p>'
    assert join_letters_in(page) == page


@pytest.mark.skipif(shutil.which("pdftocairo") is None, reason="poppler draws the PDF")
def test_joined_letters_are_drawn_the_same(svg, tmp_path):
    weasyprint = pytest.importorskip(
        "weasyprint", reason="the PDF needs WeasyPrint", exc_type=ImportError
    )
    image = pytest.importorskip("PIL.Image", reason="pixels are read with Pillow")
    drawn = []
    for name, text in (("one-by-one", svg), ("joined", join_letters(svg))):
        path = tmp_path / name
        path.with_suffix(".svg").write_text(text, "utf-8")
        page = f'<img src="{path.with_suffix(".svg").as_uri()}">'
        weasyprint.HTML(string=page).write_pdf(path.with_suffix(".pdf"))
        subprocess.run(
            ["pdftocairo", "-r", "150", "-png", "-singlefile", path.with_suffix(".pdf"), path],
            check=True,
        )
        drawn.append(np.asarray(image.open(path.with_suffix(".png"))).astype(int))
    assert (drawn[0] < 128).any()
    # A PDF rounds what it says: an edge may cover a pixel by a little more or less.
    assert np.abs(drawn[0] - drawn[1]).max() < 24

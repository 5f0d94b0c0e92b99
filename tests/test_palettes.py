import base64
import io
import shutil
import subprocess

import numpy as np
import pytest

Image = pytest.importorskip("PIL.Image", reason="pictures are made with Pillow")

from trigpoint_reporting.palettes import palette_images, read_palette  # noqa: E402
from trigpoint_reporting.pdf import write_pdf  # noqa: E402


def png(colours, *, mode="P", size=(40, 30), **settings):
    """A PNG of so many colours, and its pixels."""
    rng = np.random.default_rng(5)
    table = rng.integers(0, 256, (colours, 3), dtype=np.uint8)
    codes = rng.integers(0, colours, size[::-1]).astype(np.uint8)
    codes.flat[:colours] = np.arange(colours)
    if mode == "P":
        image = Image.fromarray(codes)
        image.putpalette(table.tobytes())
    else:
        image = Image.fromarray(table[codes]).convert(mode)
    stream = io.BytesIO()
    image.save(stream, "PNG", optimize=True, **settings)
    return stream.getvalue(), np.asarray(image.convert("RGB"))


def page(*pictures):
    body = "".join(
        f'<img alt="x" src="data:image/png;base64,{base64.b64encode(each).decode()}">'
        for each in pictures
    )
    return f'<!doctype html><html lang="en"><head><title>t</title></head><body>{body}</body></html>'


@pytest.mark.parametrize(("colours", "bits"), [(2, 1), (4, 2), (16, 4), (17, 8), (256, 8)])
def test_a_palette_is_taken_apart_at_every_depth(colours, bits):
    found = read_palette(png(colours)[0])
    assert (found.width, found.height, found.bits) == (40, 30, bits)
    assert len(found.colours) // 3 >= colours


@pytest.mark.parametrize(
    "content",
    [
        png(20, mode="RGB")[0],
        png(20, mode="L")[0],
        png(20, mode="RGBA")[0],
        png(20, transparency=3)[0],
        b"GIF89a",
    ],
)
def test_what_has_no_plain_palette_is_left_to_weasyprint(content):
    assert read_palette(content) is None
    pytest.importorskip("weasyprint", reason="WeasyPrint makes the PDF")
    assert palette_images(page(content)) == {}


def test_a_picture_comes_out_of_the_pdf_as_it_went_in(tmp_path):
    pytest.importorskip("weasyprint", reason="WeasyPrint makes the PDF")
    if shutil.which("pdfimages") is None:
        pytest.skip("pdfimages takes pictures out of a PDF")
    given = [
        png(colours) for colours in (5, 16, 200)
    ]  # two colours pdfimages writes as black on white
    path = tmp_path / "a.pdf"
    write_pdf(page(*(content for content, _ in given)), path)
    subprocess.run(["pdfimages", "-png", path, tmp_path / "out"], check=True)
    found = sorted(tmp_path.glob("out*.png"))
    assert len(found) == len(given)
    for (_, pixels), file in zip(given, found, strict=True):
        assert (np.asarray(Image.open(file).convert("RGB")) == pixels).all()
    listed = subprocess.run(
        ["pdfimages", "-list", path], check=True, capture_output=True, text=True
    ).stdout
    assert listed.count("index") == len(given)

import re

import pytest

import trigpoint_templates
from trigpoint_templates import FOLDER, FONTS, NOTEBOOK_TEMPLATE, PRINT_CSS

REPORT_CSS = NOTEBOOK_TEMPLATE / "report.css"


def luminance(colour):
    channels = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return sum(w * c for w, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def contrast(one, other):
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


@pytest.fixture(scope="module")
def colours():
    return dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6});", REPORT_CSS.read_text("utf-8")))


def test_text_is_read_easily_on_every_ground_it_stands_on(colours):
    white = "#ffffff"
    for ink in ("ink", "soft", "accent"):
        for ground in (white, colours["pale"]):
            assert contrast(colours[ink], ground) >= 4.5, (ink, ground)
    grounds = [value for name, value in colours.items() if name.endswith("-pale")]
    assert len(grounds) == 4
    assert all(contrast(colours["ink"], ground) >= 7 for ground in grounds)


def test_the_verdicts_are_told_apart_in_grey_or_by_words_alone(colours):
    # In print every tint is nearly white: nothing rests on it but the words.
    grounds = [luminance(value) for name, value in colours.items() if name.endswith("-pale")]
    assert min(grounds) > 0.85


def test_style_sheets_ask_for_nothing_but_the_fonts_beside_them():
    urls = re.findall(r"url\(([^)]*)\)", PRINT_CSS.read_text("utf-8"))
    assert urls
    assert {(FOLDER / url).parent for url in urls} == {FONTS}
    assert all((FOLDER / url).is_file() for url in urls)
    assert "url(" not in REPORT_CSS.read_text("utf-8")


def test_every_font_is_used_and_its_licence_lies_beside_it():
    used = set(re.findall(r"fonts/([\w.-]+)", PRINT_CSS.read_text("utf-8")))
    assert used == {path.name for path in FONTS.glob("*.woff")}
    licence = (FONTS / "LICENSE-IBM-Plex.txt").read_text("utf-8")
    assert "SIL Open Font License, Version 1.1" in licence
    assert "SIL Open Font License" in trigpoint_templates.__doc__


def test_the_fonts_have_figures_of_one_width():
    tt = pytest.importorskip("fontTools.ttLib", reason="WeasyPrint brings fontTools")
    for path in FONTS.glob("*.woff"):
        font = tt.TTFont(path)
        letters = font.getBestCmap()
        assert len({font["hmtx"][letters[ord(digit)]][0] for digit in "0123456789\u2212"}) <= 2
        assert len({font["hmtx"][letters[ord(digit)]][0] for digit in "0123456789"}) == 1
        assert {ord(sign) for sign in "\u2212\u00d7±≤≥≠√°²³"} <= set(letters), path.name

import base64
import re
import struct
import zlib
from html.parser import HTMLParser

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trigpoint_reporting.blocks import Passage, Picture, Table, Value
from trigpoint_reporting.render import heading, show, side_by_side, to_html, to_text

HOSTILE = (
    "<script>alert(1)</script>",
    '"); import os; ("',
    "' onload='x",
    "&lt;b&gt;",
    "{{ 7*7 }}{% x %}",
    "<!-- ",
    "]]>",
    "\u202egnp.exe",
    "\x00\x1b[31m",
    "\ud800",
)


def png(columns=4, rows=2, per_metre=None):
    def chunk(kind, content):
        check = zlib.crc32(kind + content)
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", check)

    parts = [chunk(b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0))]
    if per_metre:
        parts.append(chunk(b"pHYs", struct.pack(">IIB", per_metre, per_metre, 1)))
    parts += [chunk(b"IDAT", zlib.compress(b"\0" * (rows * (columns + 1)))), chunk(b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


class Tags(HTMLParser):
    """Every tag with its attributes, and all text."""

    def __init__(self, html):
        super().__init__()
        self.tags, self.text = [], ""
        self.feed(html)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.text += data

    def of(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]


def table(rows, columns=("Pick", "3D (m)"), **kw):
    return Table("Picks", columns, rows, **kw)


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_text_is_printed_as_itself_and_makes_no_tag(text):
    picture = Picture("p", text, text, b"<svg/>", "svg")
    blocks = [
        Passage([text, Value(text, text)]),
        Table(text, (text, text), [(text, Value(text, text))], (text,)),
        picture,
    ]
    ours = {"p", "data", "div", "table", "caption", "thead", "tbody", "tr", "th", "td", "wbr"}
    for block in blocks:
        found = Tags(to_html(block))
        assert {tag for tag, _ in found.tags} <= ours | {"figure", "figcaption", "img"}
        assert not any(key.startswith("on") for _, attributes in found.tags for key in attributes)
    printed = re.sub("[\x00-\x1f\u202e\ud800]", "\ufffd", text)
    assert Tags(to_html(blocks[0])).text == printed * 2


@given(st.text())
def test_whatever_is_printed_can_be_written_as_a_file_and_read_back(text):
    found = Tags(to_html(Passage(["[", text, "]"])))
    assert found.text.encode("utf-8").decode("utf-8").startswith("[")
    assert [tag for tag, _ in found.tags] == ["p"]


def test_a_value_says_where_in_the_results_it_stands():
    path = "reconstructions.nerf.alignment.residuals[0].dx_m"
    (found,) = Tags(to_html(Passage([Value("\u22121,234.567", path)]))).of("data")
    assert found == {"value": "-1234.567", "data-path": path}


def test_a_value_that_stands_nowhere_is_text():
    assert "<data" not in to_html(Passage([Value("6", "")]))


def test_a_table_has_a_caption_and_heads_for_columns_and_rows():
    found = Tags(to_html(table([("a", Value("0.1", "x")), ("b", "not available")])))
    assert [each["scope"] for each in found.of("th")] == ["col", "col", "row", "row"]
    assert len(found.of("caption")) == 1


def test_a_column_of_numbers_is_set_to_the_right_and_one_with_a_word_is_not():
    rows = [("a", "\u22120.123", "12 of 13"), ("b", "not available", "none")]
    found = Tags(to_html(table(rows, ("Pick", "dE (m)", "Share"))))
    assert [each.get("class") for each in found.of("td")] == ["number", None] * 2


def test_a_long_word_in_a_table_may_be_broken_and_keeps_its_letters():
    digest = "0123456789abcdef" * 4
    found = Tags(to_html(table([(digest, "x")])))
    assert len(found.of("wbr")) == 3
    assert digest in found.text


def test_a_long_word_is_broken_at_its_joints():
    html = to_html(table([("vertical_datum_unknown", "x")]))
    assert "vertical_<wbr>datum_<wbr>unknown" in html
    assert "north-west-cornice" in to_html(table([("north-west-cornice", "x")]))


def test_an_escaped_character_is_never_broken():
    html = to_html(table([("&" * 64, "x")]))
    assert "&" * 64 in Tags(html).text


def test_a_table_of_many_rows_may_cross_pages_and_a_short_one_may_not():
    def kinds(n):
        return Tags(to_html(table([("a", "1")] * n))).tags[0][1]["class"].split()

    assert "short" in kinds(5)
    assert "short" in kinds(10)  # a similarity's rows, which nobody reads from two pages
    assert "short" not in kinds(300)


def test_a_table_without_rows_is_still_a_table():
    html = to_html(table([]))
    assert len(Tags(html).of("th")) == 2
    assert "Picks" in to_text(table([]))


def test_a_picture_that_says_nothing_to_the_blind_is_refused():
    with pytest.raises(ValueError, match="no alternative text"):
        to_html(Picture("p", "caption", " ", b"<svg/>", "svg"))


def test_a_small_picture_stands_beside_the_plain_text_before_it_and_is_no_figure():
    picture = Picture("p", "caption", "finding", b"<svg/>", "svg", small=True)
    blocks = [Passage(["PASS"], "pass"), Passage(["One."]), Passage(["Two."]), picture]
    html = show(*blocks, Passage(["After."])).html
    verdict, _, rest = html.partition('<div class="beside">')
    text, _, after = rest.partition("</figure></div>")
    assert ["PASS" in verdict, "One." in text, "Two." in text, "After." in after] == [True] * 4
    assert 'class="picture"' not in html


def test_a_picture_is_embedded_as_it_is():
    content = b'<svg viewBox="0 0 1 1"><clipPath/></svg>'
    (found,) = Tags(to_html(Picture("p", "caption", "finding", content, "svg"))).of("img")
    head, _, encoded = found["src"].partition(",")
    assert head == "data:image/svg+xml;base64"
    assert base64.b64decode(encoded) == content
    assert found["alt"] == "finding"
    assert found["data-file"] == "p.svg"


def test_a_drawing_to_scale_is_printed_to_scale():
    # 400 pixels at 4,000 in a metre are a tenth of a metre.
    drawn = Picture("p", "caption", "finding", png(400, 2, per_metre=4000), "png")
    (found,) = Tags(to_html(drawn)).of("img")
    assert found["style"] == "width: 100.00mm"
    (plain,) = Tags(to_html(Picture("p", "caption", "finding", png(), "png"))).of("img")
    assert "style" not in plain


def test_blocks_are_shown_as_html_and_as_text():
    shown = show(
        Passage(["RMSE ", Value("0.137", "x"), " m"]), table([("a", "1.0")], note=("n 1",))
    )
    assert shown._repr_html_().count("<table>") == 1
    assert repr(shown).splitlines() == [
        "RMSE 0.137 m",
        "",
        "Picks",
        "Pick  3D (m)",
        "----  ------",
        "a        1.0",
        "n 1",
    ]


def test_a_heading_is_below_those_of_the_sections():
    assert heading("<b>")._repr_html_() == "<h3>&lt;b&gt;</h3>"


def narrow(caption, rows=3):
    return Table(caption, ("Item", "Value"), [(f"row {k}", "1.5") for k in range(rows)])


def test_narrow_tables_stand_side_by_side_in_pairs_and_a_lone_one_does_not():
    text = Passage(("words",))
    wide = Table("wide", ("Item", "Meaning"), [("a", "a sentence of many words " * 5)])
    blocks = [narrow("a"), narrow("b"), narrow("c"), text, narrow("d"), wide, narrow("e")]
    assert side_by_side(blocks) == {0}
    page = show(*blocks).html
    assert page.count("half") == 2
    assert 'aria-label="c"' in page.split("half")[2]
    assert side_by_side([narrow("a"), narrow("b", rows=40)]) == set()
    assert side_by_side([narrow("a"), narrow("b"), narrow("c"), narrow("d")]) == {0, 2}


def test_a_field_of_several_parts_keeps_each_numbers_path():
    interval = (Value("0.5", "a.low"), " [", Value("0.4", "a.b"), " to <", Value("0.6", ""), "]")
    shown = show(Table("t", ("Zone", "RMSE"), [("all", interval)]))
    assert '<data value="0.5" data-path="a.low">0.5</data> [<data' in shown.html
    assert "to &lt;0.6]" in shown.html
    assert '<td class="number">' in shown.html
    assert "0.5 [0.4 to <0.6]" in shown.text

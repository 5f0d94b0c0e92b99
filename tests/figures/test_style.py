import xml.etree.ElementTree as ET

import matplotlib as mpl
import pytest

from trigpoint_reporting.style import (
    LINES,
    canvas,
    labels,
    lines_of,
    listed,
    metres,
    numbered,
    percent,
    to_svg,
)


def drawing(label="a $ in a name"):
    with canvas(40) as figure:
        axes = figure.subplots()
        axes.plot([0, 1], [0, 2], label=label)
        axes.legend()
        return to_svg(figure)


def test_the_same_figure_is_the_same_bytes_whatever_the_machine_prefers():
    first = drawing()
    with mpl.rc_context({"font.size": 20, "lines.linewidth": 9, "axes.facecolor": "red"}):
        assert drawing() == first


def test_settings_of_the_caller_are_left_as_they_were():
    with mpl.rc_context({"font.size": 20}):
        drawing()
        assert mpl.rcParams["font.size"] == 20


def test_an_svg_states_no_date_no_program_and_no_font():
    text = drawing().decode()
    ET.fromstring(text)
    assert "<text" not in text
    for word in ("date", "creator", "font-family", "matplotlib.org"):
        assert word not in text.lower()


@pytest.mark.parametrize("name", ["$\\frac", "a_b^c", "<script>", "%s {0}"])
def test_a_name_is_never_read_as_a_formula(name):
    ET.fromstring(drawing(name))


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("roof", "roof"),
        ("Älvsjö œuvre", "Älvsjö œuvre"),
        ("塔の角", "no. 1"),
        ("ركن البرج", "no. 1"),
        ("two\nlines", "two lines"),
        ("\u202eevil", "no. 1"),
        ("", "no. 1"),
        ("x" * 60, "x" * 25 + " …"),
    ],
)
def test_a_label_can_be_drawn_or_gives_its_row(name, shown):
    assert labels([name]) == [shown]


def test_a_reconstruction_is_told_apart_without_colour():
    assert len({line.linestyle + line.marker for line in LINES}) == len(LINES)
    styles = lines_of([f"r{k}" for k in range(9)])
    assert len(styles) == 9


def test_numbers_have_a_true_minus_and_no_negative_zero():
    assert metres(-0.12345) == "\N{MINUS SIGN}0.123 m"
    assert metres(-1e-9) == "0.000 m"
    assert percent(None) == "not available"
    assert listed(["a"]) == "a"
    assert listed(["a", "b"]) == "a and b"


def test_names_that_are_alike_once_they_are_cut_are_shown_by_their_numbers():
    long = "the uppermost moulding of the north-eastern pinnacle, left of"
    assert labels(["roof", long, f"{long} it"]) == ["roof", "no. 2", "no. 3"]
    assert labels([long]) == ["the uppermost moulding of …"]
    assert numbered(["roof"]) == ""
    assert "number in the table of coordinates" in numbered(["roof", "no. 2"])

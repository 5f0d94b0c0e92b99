"""A figure's letters as one outline a line of text: one by one they are a third of a PDF's time."""

from __future__ import annotations

import base64
import re

SOURCE = re.compile(r'(?<=src="data:image/svg\+xml;base64,)[^"]+')
# As Matplotlib writes them: each letter's outline once, in 64ths, and then wherever it is used.
UNITS = 64
GLYPH = re.compile(r'<path id="([^"]+)"(?: d="([^"]*)")? transform="scale\(0\.015625\)"/>\s*')
USE = re.compile(r'<use xlink:href="#([^"]+)"(?: transform="translate\(([-.\d]+) ([-.\d]+)\)")?/>')
LINE = re.compile(
    r'(?:<use xlink:href="#[^"]+"(?: transform="translate\([-.\d]+ [-.\d]+\)")?/>\s*)+'
)
STEP = re.compile(r"[A-Za-z]|-?[.\d]+")


def join_letters(svg: str) -> str:
    """Return an SVG of Matplotlib's with each line of text as one path, to look the same."""
    glyphs = {name: STEP.findall(outline) for name, outline in GLYPH.findall(svg)}

    def joined(line: re.Match[str]) -> str:
        letters = USE.findall(line[0])
        if not all(name in glyphs for name, _, _ in letters):
            return line[0]  # marks of a curve, and not letters
        steps = [
            step
            for name, *place in letters
            for step in _moved(glyphs[name], [UNITS * float(each or 0) for each in place])
        ]
        return f'<path d="{" ".join(steps)}" transform="scale(0.015625)"/>\n'

    return GLYPH.sub("", LINE.sub(joined, svg))


def join_letters_in(html: str) -> str:
    """Do so in every SVG that a page holds as an image."""

    def joined(source: re.Match[str]) -> str:
        svg = join_letters(base64.b64decode(source[0]).decode("utf-8"))
        return base64.b64encode(svg.encode("utf-8")).decode("ascii")

    return SOURCE.sub(joined, html)


def _moved(outline: list[str], by: list[float]) -> list[str]:
    """Move an outline of absolute steps; x and y stand in turn after each letter."""
    moved, axis = [], 0
    for step in outline:
        if step.isalpha():
            moved.append(step)
            axis = 0
        else:
            moved.append(f"{float(step) + by[axis]:.7g}")
            axis = 1 - axis
    return moved

"""The panel's look: two palettes, a few colours that mean something, one style sheet."""

from __future__ import annotations

from typing import Literal, NamedTuple

from qtpy.QtGui import QColor, QPalette
from qtpy.QtWidgets import QApplication, QWidget

Theme = Literal["light", "dark"]


class Look(NamedTuple):
    """Colours of one theme; what means something is also said by a word."""

    window: str
    base: str
    raised: str
    text: str
    faint: str  # secondary text, still 4.5:1 on the window
    line: str
    accent: str
    on_accent: str
    info: str
    success: str
    warning: str
    error: str
    # Behind the words of a table's cells:
    amber_row: str
    red_row: str
    bar: str


LIGHT = Look(
    window="#f3f4f6",
    base="#ffffff",
    raised="#e7e9ed",
    text="#1b1e23",
    faint="#59616d",
    line="#c9ced6",
    accent="#0b63a5",
    on_accent="#ffffff",
    info="#0b63a5",
    success="#11734b",
    warning="#8a5300",
    error="#b3261e",
    amber_row="#fdf0d5",
    red_row="#fbe0de",
    bar="#b9d3ea",
)
DARK = Look(
    window="#2b2e33",
    base="#1e2125",
    raised="#393d44",
    text="#e6e8eb",
    faint="#aab2bd",
    line="#4b5159",
    accent="#5aa9e6",
    on_accent="#0c1116",
    info="#7dbcf0",
    success="#5fcf9b",
    warning="#f2b84b",
    error="#ff8a80",
    amber_row="#43371c",
    red_row="#4d2625",
    bar="#2f567a",
)
LOOKS: dict[Theme, Look] = {"light": LIGHT, "dark": DARK}


def theme_of(widget: QWidget | None = None) -> Theme:
    """Tell whether text is drawn light on dark here."""
    palette = QApplication.palette() if widget is None else widget.palette()
    dark = palette.color(QPalette.ColorRole.Window).lightness() < 128
    return "dark" if dark else "light"


def look_of(widget: QWidget | None = None) -> Look:
    """Return the colours that go with where a widget is shown."""
    return LOOKS[theme_of(widget)]


def palette_of(look: Look) -> QPalette:
    """Return a palette for a whole application."""
    role, group = QPalette.ColorRole, QPalette.ColorGroup
    palette = QPalette()
    chosen = {
        role.Window: look.window,
        role.WindowText: look.text,
        role.Base: look.base,
        role.AlternateBase: look.window,
        role.Text: look.text,
        role.Button: look.raised,
        role.ButtonText: look.text,
        role.ToolTipBase: look.raised,
        role.ToolTipText: look.text,
        role.PlaceholderText: look.faint,
        role.Highlight: look.accent,
        role.HighlightedText: look.on_accent,
        role.Link: look.accent,
        role.BrightText: look.error,
        role.Light: look.base,
        role.Midlight: look.raised,
        role.Mid: look.line,
        role.Dark: look.line,
        role.Shadow: look.line,
    }
    for each, colour in chosen.items():
        palette.setColor(each, QColor(colour))
    for each in (role.WindowText, role.Text, role.ButtonText):
        palette.setColor(group.Disabled, each, _faded(look))
    return palette


def apply_theme(application: QApplication, theme: Theme) -> None:
    """Give a whole application one of the two palettes."""
    application.setStyle("Fusion")
    application.setPalette(palette_of(LOOKS[theme]))


def sheet(look: Look) -> str:
    """Return the style sheet of the panel itself; it leaves its host's alone."""
    return f"""
    QToolBar {{ border: 0; border-bottom: 1px solid {look.line}; padding: 2px 4px; spacing: 2px; }}
    QToolBar QToolButton {{ padding: 3px 5px; border-radius: 4px; border: 1px solid transparent; }}
    QToolBar QToolButton#qt_toolbar_ext_button {{ padding: 0; border: 0; }}
    QToolBar QToolButton:hover {{ background: {look.raised}; }}
    QToolBar QToolButton:checked {{
      background: {look.raised}; color: {look.accent}; border-color: {look.line}; }}
    QToolBar QToolButton#pick-button:checked {{
      background: {look.accent}; color: {look.on_accent}; }}
    QToolBar QToolButton:checked:disabled, QToolBar QToolButton#pick-button:checked:disabled {{
      background: transparent; color: rgba{_faded(look).getRgb()}; }}
    QToolBar QToolButton:focus {{ border-color: {look.accent}; }}
    QToolBar::separator {{ background: {look.line}; width: 1px; margin: 4px 4px; }}
    CloudView {{ border: 2px solid transparent; }}
    CloudView:focus {{ border-color: {look.accent}; }}
    QTableView {{ border: 2px solid {look.line}; }}
    QTableView:focus {{ border-color: {look.accent}; }}
    QMenu {{ border: 1px solid {look.faint}; }}
    QMenu::separator {{ background: {look.line}; height: 1px; margin: 3px 6px; }}
    QCheckBox::indicator:unchecked, QMenu::indicator:non-exclusive:unchecked,
    QTableView::indicator:unchecked {{
      background: {look.base}; border: 1px solid {look.faint}; border-radius: 2px; }}
    QMenu::indicator:non-exclusive:unchecked {{ margin: 4px 0; }}
    QSplitter::handle {{ background: {look.line}; }}
    QSplitter::handle:horizontal {{ width: 3px; }}
    QSplitter::handle:vertical {{ height: 3px; }}
    QSplitter::handle:hover {{ background: {look.accent}; }}
    #rule {{ background: {look.line}; }}
    QLabel[role="heading"] {{ font-weight: 600; }}
    QLabel[role="faint"] {{ color: {look.faint}; }}
    QLabel[level="success"] {{ color: {look.success}; }}
    QLabel[level="warning"] {{ color: {look.warning}; }}
    QLabel[level="error"] {{ color: {look.error}; }}
    """


def _faded(look: Look) -> QColor:
    """Return the colour of what can't be used."""
    faded = QColor(look.faint)
    faded.setAlpha(150)
    return faded

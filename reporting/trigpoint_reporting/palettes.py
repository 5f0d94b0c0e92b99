"""Pictures with a palette enter a PDF as they are: unfolded to RGB they cost time and megabytes."""

from __future__ import annotations

import base64
import math
import re
from dataclasses import dataclass
from hashlib import md5
from typing import Any

SOURCE = re.compile(r'src="(data:image/png;base64,([^"]+))"')
SIGNATURE = b"\x89PNG\r\n\x1a\n"
INDEXED = 3  # a PNG's colour type


@dataclass(frozen=True, slots=True)
class Palette:
    """A PNG with a palette, taken apart.

    Attributes
    ----------
    width, height : int
    bits : int
        Of a pixel.
    colours : bytes
        Three for each colour.
    pixels : bytes
        Filtered and deflated, as PNG and PDF both have it.
    """

    width: int
    height: int
    bits: int
    colours: bytes
    pixels: bytes


def read_palette(content: bytes) -> Palette | None:
    """Take a PNG apart; None where it has no palette, or transparency, or is interlaced."""
    if not content.startswith(SIGNATURE):
        return None
    parts: dict[bytes, bytes] = {}
    at = len(SIGNATURE)
    while at < len(content):
        length = int.from_bytes(content[at : at + 4], "big")
        kind, data = content[at + 4 : at + 8], content[at + 8 : at + 8 + length]
        parts[kind] = parts.get(kind, b"") + data
        at += 12 + length
    head = parts[b"IHDR"]
    if head[9] != INDEXED or head[12] or b"tRNS" in parts:
        return None
    width, height = (int.from_bytes(head[k : k + 4], "big") for k in (0, 4))
    return Palette(width, height, head[8], parts[b"PLTE"], parts[b"IDAT"])


def palette_images(html: str) -> dict[str, Any]:
    """Return the page's pictures with a palette for WeasyPrint's cache of images, by their URL."""
    import pydyf  # type: ignore[import-untyped]
    from weasyprint.images import RasterImage  # type: ignore[import-untyped]

    class Indexed(RasterImage):  # type: ignore[misc]
        def __init__(self, url: str, palette: Palette) -> None:
            self.palette = palette
            self.id = md5(url.encode(), usedforsecurity=False).hexdigest()
            self.width, self.height = palette.width, palette.height
            self.ratio = palette.width / palette.height if palette.height else math.inf
            self._dpi = None

        def get_x_object(self, interpolate: bool, dpi_ratio: float) -> Any:  # noqa: ARG002
            last = len(self.palette.colours) // 3 - 1
            colours = f"<{self.palette.colours.hex()}>"
            filtering = {
                "Predictor": 15,  # each row says how it is filtered, as in a PNG
                "Colors": 1,
                "BitsPerComponent": self.palette.bits,
                "Columns": self.width,
            }
            return pydyf.Stream(
                [self.palette.pixels],
                {
                    "Type": "/XObject",
                    "Subtype": "/Image",
                    "Width": self.width,
                    "Height": self.height,
                    "ColorSpace": pydyf.Array(["/Indexed", "/DeviceRGB", last, colours]),
                    "BitsPerComponent": self.palette.bits,
                    "Interpolate": "true" if interpolate else "false",
                    "Filter": "/FlateDecode",
                    "DecodeParms": pydyf.Dictionary(filtering),
                },
            )

    found = {url: read_palette(base64.b64decode(text)) for url, text in SOURCE.findall(html)}
    return {url: Indexed(url, palette) for url, palette in found.items() if palette is not None}

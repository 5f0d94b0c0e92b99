"""The colours that a cloud itself holds, as pixels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from trigpoint.cloud import PointCloud

Colours = NDArray[np.uint8]

# One palette for pictures of one sheet: a tenth of the bytes, and no visible change.
PALETTE = 160


def photo_colours(cloud: PointCloud) -> Colours:
    """Return a cloud's red, green and blue, shape (n, 3); those of 16 bits are brought to 8."""
    parts = [cloud.attributes[name].astype(np.int64) for name in ("red", "green", "blue")]
    colours = np.stack(parts, axis=1)
    return (colours >> 8 if colours.max(initial=0) > 255 else colours).astype(np.uint8)


def fewer_colours(pictures: Sequence[Colours]) -> list[Colours]:
    """Bring pictures of shape (height, width, 3) to one small palette; white stays white."""
    flat = np.concatenate([picture.reshape(-1, 3) for picture in pictures])
    image = Image.fromarray(flat[None])
    reduced = np.array(image.quantize(PALETTE, dither=Image.Dither.NONE).convert("RGB"))[0]
    reduced[(flat == 255).all(axis=1)] = 255
    ends = np.cumsum([picture.shape[0] * picture.shape[1] for picture in pictures])[:-1]
    parts = np.split(reduced, ends)
    return [part.reshape(picture.shape) for part, picture in zip(parts, pictures, strict=True)]

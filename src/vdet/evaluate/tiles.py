"""Pictures for a page of an evaluation: a part of a frame with true and found boxes."""

from dataclasses import dataclass

import cv2
import numpy as np

from vdet.boxes import Float64Array
from vdet.draw.paint import Color
from vdet.media.images import Image

TRUE: Color = (90, 220, 60)
FOUND: Color = (40, 120, 255)
IGNORED: Color = (160, 160, 160)


@dataclass(frozen=True, slots=True)
class Tile:
    """A BGR uint8 image with the title and the caption below it."""

    image: Image
    title: str
    caption: str


Outlines = tuple[Float64Array, Color, int]
"""Boxes to draw, float64 `(n, 4)`: x1, y1, x2, y2; the colour and width of the outlines."""


def draw_tile(
    image: Image, corner: tuple[int, int], size: tuple[int, int], width: int, *outlines: Outlines
) -> Image:
    """Cut a part out of a frame, scale it to a width, and draw boxes.

    Parameters
    ----------
    image
        BGR uint8.
    corner, size
        x and y of the part, and its width and height, pixels.
    """
    (left, top), scale = corner, width / size[0]
    part = image[top : top + size[1], left : left + size[0]]
    target = width, max(1, round(size[1] * scale))
    kind = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    tile = np.asarray(cv2.resize(part, target, interpolation=kind), np.uint8)
    for boxes, color, line in outlines:
        corners = ((boxes - (left, top, left, top)) * scale).round().astype(int)
        for x1, y1, x2, y2 in corners.tolist():
            cv2.rectangle(tile, (x1, y1), (x2, y2), color, line)
    return tile

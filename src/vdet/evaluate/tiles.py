"""Parts of frames and pictures with their boxes, for pages."""

from dataclasses import dataclass

import cv2
import numpy as np

from vdet.boxes import Box, Float64Array, Image
from vdet.draw.paint import Color

TRUE: Color = (90, 220, 60)
FOUND: Color = (40, 120, 255)
IGNORED: Color = (160, 160, 160)


@dataclass(frozen=True, slots=True)
class Tile:
    """A BGR uint8 image with a title and a caption below it."""

    image: Image
    title: str
    caption: str


Outlines = tuple[Float64Array, Color, int]
"""Boxes to draw, float64 `(n, 4)`: x1, y1, x2, y2; the colour and width of the outlines."""


def draw_tile(image: Image, part: Box, width: int, *outlines: Outlines) -> Image:
    """Cut a part out of a BGR uint8 frame, scale it to a width, and draw boxes."""
    cut = part.cut(image)
    scale = width / cut.shape[1]
    target = width, max(1, round(cut.shape[0] * scale))
    kind = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    tile = np.asarray(cv2.resize(cut, target, interpolation=kind), np.uint8)
    for boxes, color, line in outlines:
        corners = ((boxes - (part.x1, part.y1, part.x1, part.y1)) * scale).round().astype(int)
        for x1, y1, x2, y2 in corners.tolist():
            cv2.rectangle(tile, (x1, y1), (x2, y2), color, line)
    return tile

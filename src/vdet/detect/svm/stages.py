"""A picture of each stage of the detection."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from vdet.boxes import Box, Image
from vdet.detect.svm.heat import Heat
from vdet.detect.svm.windows import WindowGrid, Windows
from vdet.draw.boxes import GREEN, WHITE, color_of, draw_box, draw_label, label_tag


@dataclass(frozen=True, slots=True)
class Trace:
    """What the stage pictures of a frame need.

    `hits` are the windows of at least `detector.search.probability`, `heat` is the heatmap of the
    last frames, `grids` are the window sets.
    """

    hits: Windows
    heat: Heat
    grids: tuple[WindowGrid, ...]


def stage_pictures(image: Image, trace: Trace) -> dict[str, Image]:
    """Return three pictures of a frame, BGR uint8 `(H, W, 3)`, by name: windows, hits, heat."""
    return {
        "windows": _draw_window_sets(image, trace.grids),
        "hits": _draw_hits(image, trace.hits),
        "heat": _draw_heat(image, trace.heat),
    }


def _draw_window_sets(image: Image, grids: Sequence[WindowGrid]) -> Image:
    """Draw a row of lines for each row of windows, and one whole window with size and count."""
    picture = (image * 0.6).astype(np.uint8)
    for number, grid in enumerate(grids):
        for x, y, width, height in grid.boxes.tolist():
            picture[y, max(0, x) : x + width] = color_of(number)
            if 0 <= x < picture.shape[1]:
                picture[y : y + height, x] = color_of(number)
    for number, grid in enumerate(grids):
        across = number * grid.columns // len(grids)
        example = Box.sized(*grid.boxes[across].tolist())
        draw_box(picture, example, color_of(number), f"{grid.size} px: {len(grid)} windows")
    return picture


def _draw_hits(image: Image, hits: Windows) -> Image:
    """Draw all hits, and the probability of each whose label covers no label of a likelier one."""
    picture = image.copy()
    for box in hits.boxes.tolist():
        draw_box(picture, Box.sized(*box), GREEN)
    tags: list[Box] = []
    for i in np.argsort(-hits.probabilities, kind="stable").tolist():
        box = Box.sized(*hits.boxes[i].tolist())
        text, corner = f"{hits.probabilities[i]:.2f}", (box.x1, box.y2)
        tag = label_tag(picture, text, corner)
        if not any(tag.intersection(other).area for other in tags):
            tags.append(draw_label(picture, text, corner, GREEN))
    return picture


def _draw_heat(image: Image, heat: Heat) -> Image:
    picture = blend_heat(image, heat)
    draw_label(picture, f"peak {heat.peak:.1f}", (0, 0), WHITE)
    return picture


def blend_heat(image: Image, heat: Heat) -> Image:
    """Return the darkened image with the heat over it: black, red, white at the peak."""
    scale = 255 / heat.peak if heat.peak > 0 else 0
    shade = (heat.values * scale).astype(np.uint8)
    large = np.kron(shade, np.ones((heat.shrink, heat.shrink), np.uint8))
    colored = cv2.applyColorMap(large[: image.shape[0], : image.shape[1]], cv2.COLORMAP_HOT)
    return np.asarray(cv2.addWeighted(image, 0.5, colored, 0.8, 0), np.uint8)

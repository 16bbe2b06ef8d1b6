"""A picture of each stage of the detection."""

from dataclasses import dataclass

import cv2
import numpy as np

from vdet.boxes import Box, Image
from vdet.detect.svm.heat import Heat
from vdet.detect.svm.windows import WindowGrid, Windows
from vdet.draw.boxes import GREEN, WHITE, color_of, draw_box, draw_label


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
    windows, hits = (image * 0.6).astype(np.uint8), image.copy()
    for number, grid in enumerate(trace.grids):
        boxes = [Box.sized(*box) for box in grid.boxes.tolist()]
        extent = Box(boxes[0].x1, boxes[0].y1, boxes[-1].x2, boxes[-1].y2)
        example = boxes[number * grid.columns // len(trace.grids)]
        draw_box(windows, extent, color_of(number))
        draw_box(windows, example, color_of(number), f"{grid.size} px: {len(grid)} windows")
    for row in np.argsort(trace.hits.probabilities).tolist():  # the likeliest is on top
        box = Box.sized(*trace.hits.boxes[row].tolist())
        draw_box(hits, box, GREEN, f"{trace.hits.probabilities[row]:.2f}")
    heat = blend_heat(image, trace.heat)
    draw_label(heat, f"peak {trace.heat.peak:.1f}", (0, 0), WHITE)
    return {"windows": windows, "hits": hits, "heat": heat}


def blend_heat(image: Image, heat: Heat) -> Image:
    """Return the darkened image with the heat over it: black, red, white at the peak."""
    scale = 255 / heat.peak if heat.peak > 0 else 0
    shade = (heat.values * scale).astype(np.uint8)
    large = np.kron(shade, np.ones((heat.shrink, heat.shrink), np.uint8))
    colored = cv2.applyColorMap(large[: image.shape[0], : image.shape[1]], cv2.COLORMAP_HOT)
    return np.asarray(cv2.addWeighted(image, 0.5, colored, 0.8, 0), np.uint8)

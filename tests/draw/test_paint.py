"""What is drawn into planes looks like what is drawn into images."""

from collections.abc import Callable

import av
import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from codings import in_any_coding
from vdet.boxes import Box
from vdet.config.scene import LineSettings, TrafficSettings, ZoneSettings
from vdet.draw import (
    BLACK,
    Color,
    Surface,
    draw_arrow,
    draw_box,
    draw_label,
    draw_lines,
    fill,
    shade,
    write_text,
)
from vdet.media.frame import Coding, Planes
from vdet.pages.traffic import border_marks, draw_marks
from vdet.traffic.crossings import lines_and_zones

Mask = NDArray[np.bool_]
WIDTH, HEIGHT = 320, 240
RED: Color = (40, 30, 230)


def ground(coding: Coding) -> Planes:
    """Return planes of soft colours."""
    planes = Planes(av.VideoFrame(WIDTH, HEIGHT, "yuv420p"), coding, is_writable=True)
    for layer, base in zip(planes.layers, (90, 120, 130), strict=True):
        y, x = np.mgrid[: layer.shape[0], : layer.shape[1]]
        layer[:] = base + 20 * x // WIDTH + 20 * y // HEIGHT
    return planes


PLACES = TrafficSettings(
    lines=(LineSettings(name="a", start=(0.06, 0.8), end=(0.9, 0.75), left="in", right="out"),),
    zones=(ZoneSettings(name="z", points=((0, 0.1), (0.5, 0.12), (0.3, 0.5))),),
)
[LINE], [ZONE] = lines_and_zones(PLACES, WIDTH, HEIGHT)
CORNERS = np.array([[11, 21], [151, 61], [90, 200]], np.int32)
BEYOND = np.array([[-30, 21], [151, 61], [400, 300]], np.int32)
Draw = Callable[[Surface], object]
AREAS: dict[str, Draw] = {
    "fill": lambda surface: fill(surface, Box.sized(30, 40, 120, 76), RED),
    "fill, odd corners": lambda surface: fill(surface, Box.sized(31, 41, 120, 77), RED),
    "fill, over the last corner": lambda surface: fill(surface, Box.sized(251, 201, 120, 77), RED),
    "shade": lambda surface: shade(surface, CORNERS.tolist(), RED, 0.5),
}
"""Drawings with hardly an edge."""
STROKES: dict[str, Draw] = {
    "line": lambda surface: draw_lines(surface, CORNERS, RED, 3),
    "thick line, closed": lambda surface: draw_lines(surface, CORNERS, RED, 6, closed=True),
    "line beyond the frame": lambda surface: draw_lines(surface, BEYOND, RED, 3, closed=True),
    "line between pixels": lambda surface: draw_lines(surface, CORNERS + 0.3, RED, 4),
    "arrow": lambda surface: draw_arrow(surface, (20.4, 30.2), (200, 133), RED, 3, tip=0.2),
    "text": lambda surface: write_text(
        surface, "#12 car", (41, 121), 1.2, RED, within=Box.sized(30, 60, 250, 90)
    ),
    "box": lambda surface: draw_box(surface, Box.sized(51, 61, 101, 83), RED, "#1 0.9"),
    "label": lambda surface: draw_label(surface, "0:01:02.500", (0, HEIGHT), RED),
    "lines": lambda surface: draw_lines(surface, [(20 + 5 * n, 60 + n) for n in range(40)], RED, 6),
    "zone": lambda surface: draw_marks(surface, border_marks(ZONE, {}, ": 4")),
    "counts": lambda surface: draw_marks(surface, border_marks(LINE, {("a", "in"): 3})),
}
"""Drawings that are mostly edges, where 4:2:0 has less of the colour than an image."""
DRAWINGS = AREAS | STROKES


def covered(draw: Draw) -> Mask:
    """Tell which pixels of an image a drawing changes, whatever their colour."""
    dark = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    bright = np.full_like(dark, 255)
    draw(dark)
    draw(bright)
    return np.asarray((dark != 0).any(axis=2) | (bright != 255).any(axis=2))


def halved(mask: Mask) -> Mask:
    """Tell which values of chroma stand for a pixel of a mask."""
    even = np.pad(mask, [(0, side % 2) for side in mask.shape])
    return np.asarray(even[::2, ::2] | even[1::2, ::2] | even[::2, 1::2] | even[1::2, 1::2])


def grown(mask: Mask) -> Mask:
    return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((3, 3))) > 0)


@in_any_coding
@pytest.mark.parametrize("name", DRAWINGS)
def test_planes_look_like_the_same_drawing_in_an_image(name: str, coding: Coding) -> None:
    """Nothing else is changed: of chroma, only values next to those that are drawn on."""
    draw, before, after = DRAWINGS[name], ground(coding), ground(coding)
    image = before.to_image()
    draw(after)
    draw(image)
    expected = Planes.of_image(image, coding).luma.astype(int)
    assert np.abs(after.luma - expected).max() <= 5
    drawn = covered(draw)
    differences = np.abs(after.to_image().astype(int) - image).max(axis=2)
    assert differences[drawn].mean() < (4 if name in AREAS else 50)
    changed = after.luma != before.luma
    assert changed.any()
    assert not (changed & ~drawn).any()
    changed = (after.blue != before.blue) | (after.red != before.red)
    assert changed.any()
    assert not (changed & ~grown(halved(drawn))).any()


def test_points_of_a_line_may_lie_far_outside_the_picture() -> None:
    image = np.full((120, 240, 3), 255, np.uint8)
    draw_lines(image, [(-1e9, 60.0), (120.0, 60.0), (1e9, 60.0)], BLACK, 6)
    assert (image.min(axis=(0, 2)) == 0).all()

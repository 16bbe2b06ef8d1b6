"""Labelled patches cut from rendered roads, in the layout of the Udacity data set.

Vehicles form the groups `near` and `far`. Non-vehicles form the groups `road` (any place of the
frame) and `parts` (a corner of a vehicle, or a vehicle that is far too small for the patch).
"""

from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from vdet.boxes import Box, Image
from vdet.synthetic import Renderer, TrueBox, busy_road, true_boxes
from writing import write_image

PATCH = 64
"""Side of a patch, pixels."""

_MAX_VEHICLE = 0.15  # largest fraction of a background patch that vehicles fill
_FAR = 130  # windows narrower than this many pixels are `far`
_SMALLEST = 32  # minimum side of a window, pixels of the frame


GROUPS = ("vehicles/near", "vehicles/far", "non-vehicles/road", "non-vehicles/parts")


def write_patches(folder: Path, *, seed: int, each: int) -> None:
    """Write `vehicles/near/image0001.png` …: `each` patches of every group."""
    rng = np.random.default_rng(seed)
    for group in GROUPS:
        (folder / group).mkdir(parents=True)
        for number, patch in enumerate(islice(draw_patches(group, rng), each), start=1):
            write_image(folder / group / f"image{number:04}.png", patch)


def draw_patches(group: str, rng: np.random.Generator) -> Iterator[Image]:
    """Cut patches of a group from frames of one random road after another, without end."""
    while True:
        scene = busy_road(rng)
        renderer = Renderer(scene)
        for index in range(scene.frames):
            image, vehicles = renderer.image(index), true_boxes(scene, index)
            for window in _windows(group, image, vehicles, rng):
                if window.width >= _SMALLEST and window.clipped(*image.shape[1::-1]) == window:
                    yield _cut(image, window, rng)


def _windows(
    group: str, image: Image, vehicles: Sequence[TrueBox], rng: np.random.Generator
) -> list[Box]:
    if group.startswith("vehicles"):
        seen = [_around(vehicle.box, rng) for vehicle in vehicles if vehicle.hidden < 0.1]
        return [window for window in seen if (window.width < _FAR) == (group == "vehicles/far")]
    if group == "non-vehicles/road":
        windows = [_anywhere(image, rng) for _ in range(8)]
    else:
        windows = [_at_edge(vehicle.box, rng) for vehicle in vehicles]
    return [window for window in windows if not _is_filled(window, vehicles)]


def _around(box: Box, rng: np.random.Generator) -> Box:
    """Return a square around a box, with a random error in place and size.

    On a wide box (a visible side) it may be as narrow as the box is high.
    """
    side = max(1.1 * box.height, rng.uniform(0.8, 1.25) * box.width)
    x, y = np.array(box.center) + rng.uniform(-0.08, 0.08, 2) * side - side / 2
    return Box.sized(round(x), round(y), round(side), round(side))


def _anywhere(image: Image, rng: np.random.Generator) -> Box:
    height, width = image.shape[:2]
    side = int(height * rng.uniform(0.08, 0.4))
    x, y = rng.integers(0, (width - side, height - side))
    return Box.sized(int(x), int(y), side, side)


def _at_edge(box: Box, rng: np.random.Generator) -> Box:
    """Return a square that cuts a vehicle's box at its edge, or is far larger than the box."""
    side = max(box.width, box.height) * (3 if rng.random() < 0.3 else 1)
    angle = rng.uniform(0, 2 * np.pi)
    x = box.center[0] + np.cos(angle) * (box.width + side) * 0.42 - side / 2
    y = box.center[1] + np.sin(angle) * (box.height + side) * 0.42 - side / 2
    return Box.sized(round(x), round(y), side, side)


def _is_filled(window: Box, vehicles: Sequence[TrueBox]) -> bool:
    filled = sum(window.intersection(vehicle.box).area for vehicle in vehicles)
    return filled > _MAX_VEHICLE * window.area


def _cut(image: Image, window: Box, rng: np.random.Generator) -> Image:
    """Return a window as a patch, with random exposure, mirrored or not."""
    patch = cv2.resize(window.cut(image), (PATCH, PATCH), interpolation=cv2.INTER_AREA)
    patch = patch[:, :: rng.choice([1, -1])]
    return np.asarray(np.clip(patch * rng.uniform(0.75, 1.25), 0, 255), np.uint8)

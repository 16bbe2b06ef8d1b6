"""Labelled patches cut from rendered roads, in the layout of the Udacity data set.

Vehicles form the groups `near` and `far`. Non-vehicles form the groups `road` (any place along the
carriageway), `roadside` (objects beside it) and `parts` (a corner of a vehicle, or a vehicle that
is far too small for the patch).
"""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from vdet.boxes import Box, Image
from vdet.files import make_folder
from vdet.synthetic import PERIOD, Renderer, Scene, TrueBox, busy_road, true_boxes
from writing import write_image

PATCH = 64
"""Side of a patch, pixels."""

VEHICLE_GROUPS: tuple[str, ...] = ("near", "far")
BACKGROUND_GROUPS: tuple[str, ...] = ("road", "roadside", "parts")

_MAX_VEHICLE = 0.15  # largest fraction of a background patch that vehicles fill
_FAR = 130  # windows narrower than this many pixels are `far`
_SMALLEST = 32  # minimum side of a window, pixels of the frame
_OBJECTS = 8  # most roadside objects taken from a frame


_Sample = tuple[str, Image]
"""The group of a patch, and the patch, BGR uint8 `(64, 64, 3)`."""

_Frame = tuple[Image, tuple[TrueBox, ...], tuple[Box, ...]]
"""A rendered frame, its vehicles, and the boxes of some objects beside the road."""


def draw_patches(count: int, rng: np.random.Generator, *, vehicles: bool) -> list[_Sample]:
    """Draw patches of cars seen from behind, or patches without a whole vehicle.

    The groups get the same number of patches, to within one.
    """
    samples = _vehicle_samples(rng) if vehicles else _background_samples(rng)
    groups = VEHICLE_GROUPS if vehicles else BACKGROUND_GROUPS
    missing = {group: (count + i) // len(groups) for i, group in enumerate(groups)}
    kept: list[_Sample] = []
    while len(kept) < count:
        group, patch = next(samples)
        if missing[group]:
            missing[group] -= 1
            kept.append((group, patch))
    return kept


def write_patches(folder: Path, *, seed: int, vehicles: int, non_vehicles: int) -> None:
    """Write `vehicles/<group>/image0001.png` … and `non-vehicles/<group>/…` below a folder."""
    rng = np.random.default_rng(seed)
    drawn = {
        "vehicles": draw_patches(vehicles, rng, vehicles=True),
        "non-vehicles": draw_patches(non_vehicles, rng, vehicles=False),
    }
    for name, samples in drawn.items():
        numbers: Counter[str] = Counter()
        for group, patch in samples:
            numbers[group] += 1
            make_folder(folder / name / group)
            path = folder / name / group / f"image{numbers[group]:04}.png"
            write_image(path, patch)


def _vehicle_samples(rng: np.random.Generator) -> Iterator[_Sample]:
    for image, vehicles, _ in _labelled_frames(rng):
        for vehicle in vehicles * 2:
            window = _around(vehicle.box, rng)
            if vehicle.hidden < 0.1 and _fits(window, image):
                group = "far" if window.width < _FAR else "near"
                yield group, _cut(image, window, rng)


def _background_samples(rng: np.random.Generator) -> Iterator[_Sample]:
    for image, vehicles, objects in _labelled_frames(rng):
        windows = [("road", _along_road(image, rng)) for _ in range(8)]
        windows += [("roadside", _around(box, rng)) for box in objects]
        windows += [("parts", _at_edge(vehicle.box, rng)) for vehicle in vehicles * 4]
        for group, window in windows:
            if _fits(window, image) and not _is_filled(window, vehicles):
                yield group, _cut(image, window, rng)


def _around(box: Box, rng: np.random.Generator) -> Box:
    """Return a square around a box, with a random error in place and size.

    On a wide box (a visible side) it may be as narrow as the box is high.
    """
    side = max(1.1 * box.height, rng.uniform(0.8, 1.25) * box.width)
    x, y = np.array(box.center) + rng.uniform(-0.08, 0.08, 2) * side - side / 2
    return Box.sized(round(x), round(y), round(side), round(side))


def _along_road(image: Image, rng: np.random.Generator) -> Box:
    height, width = image.shape[:2]
    side = int(height * rng.uniform(0.08, 0.4))
    x, y = rng.integers(0, (width - side, height - side))
    return Box.sized(int(x), int(y), side, side)


def _at_edge(box: Box, rng: np.random.Generator) -> Box:
    """Return a square that cuts a vehicle's box at its edge, or is far larger than the box."""
    side = max(box.width, box.height)
    if rng.random() < 0.3:
        side *= 3
    angle = rng.uniform(0, 2 * np.pi)
    x = box.center[0] + np.cos(angle) * (box.width + side) * 0.42 - side / 2
    y = box.center[1] + np.sin(angle) * (box.height + side) * 0.42 - side / 2
    return Box.sized(round(x), round(y), side, side)


def _fits(window: Box, image: Image) -> bool:
    """Tell whether a window lies in the frame and is large enough."""
    height, width = image.shape[:2]
    return window.width >= _SMALLEST and window.clipped(width, height) == window


def _is_filled(window: Box, vehicles: tuple[TrueBox, ...]) -> bool:
    filled = sum(window.intersection(vehicle.box).area for vehicle in vehicles)
    return filled > _MAX_VEHICLE * window.area


def _cut(image: Image, window: Box, rng: np.random.Generator) -> Image:
    """Return a window as a patch, with random blur, mirroring and exposure."""
    patch = cv2.resize(window.cut(image), (PATCH, PATCH), interpolation=cv2.INTER_AREA)
    if rng.random() < 0.4:
        patch = cv2.GaussianBlur(patch, (0, 0), float(rng.uniform(0.4, 1.2)))
    if rng.random() < 0.5:
        patch = cv2.flip(patch, 1)
    return np.asarray(np.clip(patch * rng.uniform(0.75, 1.25), 0, 255), np.uint8)


def _labelled_frames(rng: np.random.Generator) -> Iterator[_Frame]:
    """Render frames of one random road after another, without end."""
    while True:
        scene = busy_road(rng)
        renderer = Renderer(scene)
        for index in range(scene.frames):
            image = _compressed(renderer.image(index), rng)
            yield image, true_boxes(scene, index), _objects(scene, index)


def _compressed(image: Image, rng: np.random.Generator) -> Image:
    """Return a frame with the losses of JPEG compression, since all real frames have some."""
    quality = int(rng.integers(30, 95))
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR_BGR), np.uint8)


def _objects(scene: Scene, index: int) -> tuple[Box, ...]:
    """Return the boxes of some objects beside the road."""
    station = scene.station(index)
    boxes = []
    for item in scene.roadside:
        ahead = (item.station - station) % PERIOD
        if 8 < ahead < 70:
            left, right = item.lateral - item.width / 2, item.lateral + item.width / 2
            corners = np.array([[left, item.height, ahead], [right, 0.0, ahead]])
            (x0, y0), (x1, y1) = scene.camera.project(corners)
            boxes.append(Box.sized(round(x0), round(y0), round(x1 - x0), round(y1 - y0)))
    inside = [b for b in boxes if b.clipped(scene.camera.width, scene.camera.height) == b]
    return tuple(inside[:_OBJECTS])

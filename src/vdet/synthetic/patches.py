"""Labelled patches cut from rendered roads, in the layout of the Udacity set.

Vehicles come in the groups `near` and `far`, non-vehicles as `road` (anything along the
carriageway), `roadside` (what stands beside it) and `parts` (a corner of a vehicle, or one that is
far too small for the patch).
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from vdet.errors import OutputError
from vdet.geometry import Box
from vdet.media.images import Image, write_image
from vdet.synthetic.truth import TrueBox
from vdet.synthetic.views import views

PATCH = 64
"""Side of a patch, pixels."""

VEHICLE_GROUPS = ("near", "far")
BACKGROUND_GROUPS = ("road", "roadside", "parts")

_MOST_VEHICLE = 0.15  # share of a background patch that a vehicle may fill
_FAR = 130  # windows narrower than this many pixels are `far`
_SMALLEST = 32  # pixels of the frame along a window's side


@dataclass(frozen=True, slots=True)
class _Sample:
    group: str
    patch: Image


def vehicle_patches(count: int, rng: np.random.Generator) -> Image:
    """Return patches of cars seen from behind, BGR uint8 `(count, 64, 64, 3)`."""
    return _stacked(_collect(_vehicle_samples(rng), VEHICLE_GROUPS, count))


def background_patches(count: int, rng: np.random.Generator) -> Image:
    """Return patches that no vehicle fills, BGR uint8 `(count, 64, 64, 3)`."""
    return _stacked(_collect(_background_samples(rng), BACKGROUND_GROUPS, count))


def write_patches(folder: Path, *, seed: int, vehicles: int, non_vehicles: int) -> None:
    """Write `vehicles/<group>/image0001.png` … and `non-vehicles/<group>/…` below a folder.

    The groups of a class get the same number of patches, to within one.

    Raises
    ------
    OutputError
        A folder or file cannot be written.
    """
    rng = np.random.default_rng(seed)
    _write(folder / "vehicles", _collect(_vehicle_samples(rng), VEHICLE_GROUPS, vehicles))
    background = _collect(_background_samples(rng), BACKGROUND_GROUPS, non_vehicles)
    _write(folder / "non-vehicles", background)


def _stacked(samples: list[_Sample]) -> Image:
    patches = [sample.patch for sample in samples]
    return np.stack(patches) if patches else np.zeros((0, PATCH, PATCH, 3), np.uint8)


def _write(folder: Path, samples: list[_Sample]) -> None:
    numbers: Counter[str] = Counter()
    for sample in samples:
        numbers[sample.group] += 1
        path = folder / sample.group / f"image{numbers[sample.group]:04}.png"
        _make_folder(path.parent)
        write_image(path, sample.patch)


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made: {error.strerror}") from error


def _collect(samples: Iterator[_Sample], groups: tuple[str, ...], count: int) -> list[_Sample]:
    """Take samples as they come until each group has its share of `count`."""
    missing = {group: (count + i) // len(groups) for i, group in enumerate(groups)}
    kept: list[_Sample] = []
    while len(kept) < count:
        sample = next(samples)
        if missing[sample.group]:
            missing[sample.group] -= 1
            kept.append(sample)
    return kept


def _vehicle_samples(rng: np.random.Generator) -> Iterator[_Sample]:
    for view in views(rng):
        for vehicle in view.vehicles * 2:
            window = _around(vehicle.box, rng)
            if vehicle.visibility > 0.9 and _fits(window, view.image):
                group = "far" if window.width < _FAR else "near"
                yield _Sample(group, _cut(view.image, window, rng))


def _background_samples(rng: np.random.Generator) -> Iterator[_Sample]:
    for view in views(rng):
        windows = [("road", _along_road(view.image, rng)) for _ in range(8)]
        windows += [("roadside", _around(box, rng)) for box in view.objects]
        windows += [("parts", _at_edge(vehicle.box, rng)) for vehicle in view.vehicles * 4]
        for group, window in windows:
            if _fits(window, view.image) and not _filled(window, view.vehicles):
                yield _Sample(group, _cut(view.image, window, rng))


def _around(box: Box, rng: np.random.Generator) -> Box:
    """Return a square about a box, a little off in place and size.

    On a wide box (a side in view) it may be as narrow as the box is high.
    """
    side = max(1.1 * box.height, rng.uniform(0.8, 1.25) * box.width)
    x, y = np.array(box.center) + rng.uniform(-0.08, 0.08, 2) * side - side / 2
    return Box(round(x), round(y), round(side), round(side))


def _along_road(image: Image, rng: np.random.Generator) -> Box:
    height, width = image.shape[:2]
    side = int(height * rng.uniform(0.08, 0.4))
    x, y = rng.integers(0, (width - side, height - side))
    return Box(int(x), int(y), side, side)


def _at_edge(box: Box, rng: np.random.Generator) -> Box:
    """Return a square of a window's size that touches a vehicle's box, or swallows it whole."""
    side = max(box.width, box.height)
    if rng.random() < 0.3:
        side *= 3
    angle = rng.uniform(0, 2 * np.pi)
    x = box.center[0] + np.cos(angle) * (box.width + side) * 0.42 - side / 2
    y = box.center[1] + np.sin(angle) * (box.height + side) * 0.42 - side / 2
    return Box(round(x), round(y), side, side)


def _fits(window: Box, image: Image) -> bool:
    """Tell whether a window lies in the frame and is large enough to show anything."""
    height, width = image.shape[:2]
    return window.width >= _SMALLEST and window.clipped(width, height) == window


def _filled(window: Box, vehicles: tuple[TrueBox, ...]) -> bool:
    filled = sum(window.intersection(vehicle.box).area for vehicle in vehicles)
    return filled > _MOST_VEHICLE * window.area


def _cut(image: Image, window: Box, rng: np.random.Generator) -> Image:
    """Return a window as a patch, as another lens and exposure might give it."""
    part = image[window.y : window.bottom, window.x : window.right]
    patch = cv2.resize(part, (PATCH, PATCH), interpolation=cv2.INTER_AREA)
    if rng.random() < 0.4:
        patch = cv2.GaussianBlur(patch, (0, 0), float(rng.uniform(0.4, 1.2)))
    if rng.random() < 0.5:
        patch = cv2.flip(patch, 1)
    return np.asarray(np.clip(patch * rng.uniform(0.75, 1.25), 0, 255), np.uint8)

"""The true boxes of the vehicles in a scene, from the outlines drawn."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from vdet.boxes import Box, Float64Array
from vdet.files import staged
from vdet.media.images import Image
from vdet.synthetic.camera import fill_mask
from vdet.synthetic.scene import Scene
from vdet.synthetic.vehicle import outlines

SMALLEST = (40, 24)
"""Least width and height, in pixels of a 720-row frame, of a vehicle that must be found."""

_CAR = 3  # class number in MOTChallenge
_RASTER = 256  # pixels along the longer side of the image in which a whole outline is measured


@dataclass(frozen=True, slots=True)
class TrueBox:
    """The place of a vehicle in a frame, without its shadow on the ground.

    `box` bounds the part inside the frame, also where nearer vehicles hide it.
    `visibility` is the share of its outline that is inside the frame and not hidden; `hidden` is
    the share of the part inside the frame that nearer vehicles hide. Both are 0 to 1.
    """

    id: int
    box: Box
    visibility: float
    hidden: float


def true_boxes(scene: Scene, index: int) -> tuple[TrueBox, ...]:
    """Return the vehicles of which a part lies inside frame `index`, ordered by id."""
    camera, time = scene.camera, scene.time(index)
    covered = np.zeros((camera.height, camera.width), np.uint8)
    found = []
    for _, vehicle in scene.nearest_first(time):
        parts = [outline for outline, _color in outlines(vehicle, camera, time)]
        mask = _mask(parts, covered.shape)
        if mask.any():
            found.append(_true_box(vehicle.id, mask, covered, _area(parts)))
        covered |= mask
    return tuple(sorted(found, key=lambda box: box.id))


def must_be_found(vehicle: TrueBox, frame_height: int) -> bool:
    """Tell whether a vehicle must be found: it is large enough, and at most half of it is hidden.

    The smallest size is `SMALLEST` in a frame of 720 rows and grows with the frame. For a vehicle
    that the frame's edge cuts, the size of the part inside decides.
    """
    width, height = (length * frame_height / 720 for length in SMALLEST)
    large = vehicle.box.width >= width and vehicle.box.height >= height
    return large and vehicle.hidden <= 0.5


def _true_box(number: int, mask: Image, covered: Image, whole: float) -> TrueBox:
    inside = cv2.countNonZero(mask)
    free = cv2.countNonZero(mask & ~covered)
    box = Box.sized(*cv2.boundingRect(mask))
    return TrueBox(number, box, visibility=min(1.0, free / whole), hidden=1 - free / inside)


def _mask(parts: list[Float64Array], shape: tuple[int, ...]) -> Image:
    mask = np.zeros(shape, np.uint8)
    for part in parts:
        fill_mask(mask, part)
    return mask


def _area(parts: list[Float64Array]) -> float:
    """Return the pixels that the union of outlines covers, wherever it lies.

    A vehicle beside the camera reaches thousands of pixels beyond the frame, so it is measured in
    a small image of its own.
    """
    points = np.concatenate(parts)
    low = points.min(axis=0)
    scale = (_RASTER - 1) / max(1.0, float((points.max(axis=0) - low).max()))
    mask = _mask([(part - low) * scale for part in parts], (_RASTER, _RASTER))
    return cv2.countNonZero(mask) / scale**2


def write_truth(path: Path, scene: Scene, *, overwrite: bool = False) -> None:
    """Write the true box of each vehicle, in the columns of MOTChallenge ground truth.

    One line per box: `frame, id, left, top, width, height, flag, class, visibility`; frames and
    pixels count from 1, the class is 3 (car). The flag is 1 for a vehicle that must be
    found and 0 for an ignore region (`must_be_found`).

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    lines = [
        _line(index + 1, box, scene.camera.height)
        for index in range(scene.frames)
        for box in true_boxes(scene, index)
    ]
    with staged(path, overwrite=overwrite) as temporary:
        temporary.write_text("".join(lines), encoding="ascii", newline="\n")


def _line(number: int, vehicle: TrueBox, frame_height: int) -> str:
    x, y, width, height = vehicle.box.xywh
    flag = int(must_be_found(vehicle, frame_height))
    place = f"{x + 1},{y + 1},{width},{height}"
    return f"{number},{vehicle.id},{place},{flag},{_CAR},{vehicle.visibility:.3f}\n"

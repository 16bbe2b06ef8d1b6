"""The true boxes of the vehicles in a scene, from the outlines that are drawn."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from vdet.boxes import Box
from vdet.files import write_whole
from vdet.synthetic.camera import fill_outline
from vdet.synthetic.scene import Scene
from vdet.synthetic.vehicle import outlines

SMALLEST = (40, 24)
"""Minimum width and height, in pixels of a 720-row frame, of a vehicle that must be found."""

_CAR = 3  # class number in MOTChallenge
_WHITE = 255, 255, 255


@dataclass(frozen=True, slots=True)
class TrueBox:
    """The place of a vehicle in a frame, without its shadow on the ground.

    `box` bounds the part inside the frame, including what nearer vehicles hide. `hidden` is the
    fraction of this part that they hide, 0 to 1.
    """

    id: int
    box: Box
    hidden: float


def true_boxes(scene: Scene, index: int) -> tuple[TrueBox, ...]:
    """Return the vehicles that are at least partly inside frame `index`, ordered by id."""
    camera = scene.camera
    covered = np.zeros((camera.height, camera.width), np.uint8)
    boxes = []
    for position, vehicle in scene.nearest_first(scene.time(index)):
        mask = np.zeros_like(covered)
        for outline, _ in outlines(vehicle, position, camera):
            fill_outline(mask, outline, _WHITE, smooth=False)
        if inside := cv2.countNonZero(mask):
            hidden = cv2.countNonZero(mask & covered) / inside
            x, y, width, height = cv2.boundingRect(mask)
            boxes.append(TrueBox(vehicle.id, Box.sized(x, y, width, height), hidden))
        covered |= mask
    return tuple(sorted(boxes, key=lambda box: box.id))


def must_be_found(vehicle: TrueBox, frame_height: int) -> bool:
    """Return whether a vehicle must be found: it is large enough, and at most half of it is hidden.

    The smallest size is `SMALLEST` in a frame of 720 rows and grows with the frame. For a vehicle
    that the frame's edge cuts, the size of the part inside counts.
    """
    width, height = (length * frame_height / 720 for length in SMALLEST)
    large = vehicle.box.width >= width and vehicle.box.height >= height
    return large and vehicle.hidden <= 0.5


def write_truth(path: Path, scene: Scene, *, overwrite: bool = False) -> None:
    """Write the true box of each vehicle, in the columns of MOTChallenge ground truth.

    One line per box: `frame, id, left, top, width, height, flag, class, visibility`; frames and
    pixels count from 1, the class is 3 (car), the visibility is 1 - `hidden`. The flag is 1 for a
    vehicle that must be found and 0 for an ignore region (`must_be_found`).

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    lines = []
    for index in range(scene.frames):
        for vehicle in true_boxes(scene, index):
            x, y, width, height = vehicle.box.xywh
            flag = int(must_be_found(vehicle, scene.camera.height))
            box = f"{x + 1},{y + 1},{width},{height}"
            quality = f"{flag},{_CAR},{1 - vehicle.hidden:.3f}"
            lines.append(f"{index + 1},{vehicle.id},{box},{quality}\n")
    write_whole(path, "".join(lines), overwrite=overwrite)

"""A slow and thorough search of a frame, for labels that nobody has drawn.

The frame is searched as it is and mirrored, and so are parts of it, in which vehicles are larger
for a detector that scales what it gets. Boxes of one vehicle become one.
Source of the joined boxes: Solovyev, Wang and Gabruseva, "Weighted Boxes Fusion: Ensembling Boxes
from Different Object Detection Models", 2021.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from vdet.detect.detections import Detections
from vdet.detect.protocol import DetectorModel
from vdet.geometry import Float64Array, Int64Array, iou_matrix, to_sides
from vdet.media import Picture
from vdet.media.images import Image

_PARTS = 3  # beside one another, each of half the frame's width and height
_SAME = 0.5  # least intersection over union of boxes of one vehicle
_EDGE = 2  # pixels: a box so close to the side of a part may be cut off there


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a frame, pixels; `level` counts how often it is halved, from 0."""

    level: int
    left: int
    top: int
    right: int
    bottom: int

    def cut(self, image: Image) -> Image:
        """Return its pixels."""
        return image[self.top : self.bottom, self.left : self.right]

    def shows_whole(self, box: Float64Array, whole: "Part") -> bool:
        """Tell whether no side of the part cuts the box x1, y1, x2, y2 off, but for the frame's."""
        inside = (
            box[0] >= self.left + _EDGE or self.left == whole.left,
            box[1] >= self.top + _EDGE or self.top == whole.top,
            box[2] <= self.right - _EDGE or self.right == whole.right,
            box[3] <= self.bottom - _EDGE or self.bottom == whole.bottom,
        )
        return all(inside)


def parts_of(width: int, height: int) -> list[Part]:
    """Return the whole frame, and parts of it in its middle rows."""
    half, top = width // 2, height // 4
    lefts = [round(number * (width - half) / (_PARTS - 1)) for number in range(_PARTS)]
    whole = Part(0, 0, 0, width, height)
    return [whole, *(Part(1, left, top, left + half, height - top) for left in lefts)]


class Teacher:
    """Searches frames of one size with a detector, several times each.

    Parameters
    ----------
    model
        A detector that shows detections of every score (`DetectorSettings.showing_all`).
    """

    def __init__(self, model: DetectorModel, width: int, height: int) -> None:
        self._model = model
        self._passes = list(product(parts_of(width, height), (False, True)))

    def detect(self, image: Image) -> Detections:
        """Return one detection for each vehicle in a frame, BGR uint8 `(H, W, 3)`.

        Its box is the mean of those found, weighted by score. Its score is the mean over the passes
        in which the vehicle lies as a whole, at the level of detail at which that is highest.
        Raises `ImageError`.
        """
        found = [self._search(image, part, mirrored=mirrored) for part, mirrored in self._passes]
        boxes = np.concatenate([each.boxes for each in found]).astype(np.float64)
        scores = np.concatenate([each.scores for each in found]).astype(np.float64)
        numbers = np.repeat(np.arange(len(found)), [len(each) for each in found])
        joined = [
            (np.average(boxes[rows], axis=0, weights=scores[rows]), rows)
            for rows in _alike(boxes, scores)
        ]
        return Detections(
            np.reshape([box for box, _ in joined], (-1, 4)),
            [self._score(box, scores[rows], numbers[rows]) for box, rows in joined],
        )

    def _search(self, image: Image, part: Part, *, mirrored: bool) -> Detections:
        """Return what one pass finds, in pixels of the frame, without what it cuts off."""
        pixels = np.ascontiguousarray(part.cut(image)[:, ::-1] if mirrored else part.cut(image))
        height, width = pixels.shape[:2]
        detector = self._model.for_video(width, height, [pixels])
        found = detector.detect(detector.search(Picture(pixels), None))
        boxes = found.boxes.astype(np.float64)
        if mirrored:
            boxes[:, [0, 2]] = width - boxes[:, [2, 0]]
        boxes += np.tile([part.left, part.top], 2)
        whole = self._passes[0][0]
        kept = [row for row, box in enumerate(boxes) if part.shows_whole(box, whole)]
        return Detections(boxes[kept], found.scores[kept])

    def _score(self, box: Float64Array, scores: Float64Array, numbers: Int64Array) -> float:
        """Return the score of a box that the passes `numbers` have found with these scores."""
        best = np.zeros(len(self._passes))
        np.maximum.at(best, numbers, scores)
        whole = self._passes[0][0]
        seen = {
            number: part.level
            for number, (part, _) in enumerate(self._passes)
            if part.shows_whole(box, whole)
        }
        levels = set(seen.values())
        means = [
            np.mean([best[n] for n, each in seen.items() if each == level]) for level in levels
        ]
        return float(max(means))


def _alike(boxes: Float64Array, scores: Float64Array) -> Iterator[Int64Array]:
    """Yield the rows of each vehicle: the best box that is left, and those that overlap with it."""
    left = np.argsort(-scores, kind="stable")
    sides = to_sides(boxes)
    while len(left):
        overlaps = iou_matrix(sides[left[:1]], sides[left])[0]
        yield left[overlaps >= _SAME]
        left = left[overlaps < _SAME]

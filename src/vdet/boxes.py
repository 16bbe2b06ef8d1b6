"""Rectangles in an image: x to the right, y down, the far sides exclusive.

`Box` is one rectangle of whole pixels. The functions take many boxes as float64 arrays of
`x, y, width, height` in pixels.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Float32Array = npt.NDArray[np.float32]
Float64Array = npt.NDArray[np.float64]
Int32Array = npt.NDArray[np.int32]
Int64Array = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

_NESTED = 0.8
"""Share of a box that lies in another one, if it lies in it."""


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle of `width` × `height` pixels whose top-left pixel is `(x, y)`.

    It covers the columns `x … x + width - 1` and the rows `y … y + height - 1`.
    """

    x: int
    y: int
    width: int
    height: int

    @property
    def right(self) -> int:
        """First column beyond the box."""
        return self.x + self.width

    @property
    def bottom(self) -> int:
        """First row beyond the box."""
        return self.y + self.height

    @property
    def area(self) -> int:
        """Pixels covered; 0 for a box without width or height."""
        return max(0, self.width) * max(0, self.height)

    @property
    def center(self) -> tuple[float, float]:
        """The middle, `(x, y)` in pixels."""
        return self.x + self.width / 2, self.y + self.height / 2

    @property
    def foot(self) -> tuple[float, float]:
        """The middle of the lower edge, `(x, y)` in pixels."""
        return self.x + self.width / 2, float(self.bottom)

    def contains(self, point: tuple[float, float]) -> bool:
        """Tell whether `point`, `(x, y)` in pixels, lies in the box."""
        x, y = point
        return self.x <= x < self.right and self.y <= y < self.bottom

    def moved_to(self, x: int, y: int) -> "Box":
        """Return a box of the same size with its top-left pixel at `(x, y)`."""
        return Box(x, y, self.width, self.height)

    def union(self, other: "Box") -> "Box":
        """Return the smallest box that covers both."""
        x, y = min(self.x, other.x), min(self.y, other.y)
        return Box(x, y, max(self.right, other.right) - x, max(self.bottom, other.bottom) - y)

    def intersection(self, other: "Box") -> "Box":
        """Return the part in common; its area is 0 where there is none."""
        x, y = max(self.x, other.x), max(self.y, other.y)
        width = min(self.right, other.right) - x
        height = min(self.bottom, other.bottom) - y
        return Box(x, y, max(0, width), max(0, height))

    def clipped(self, width: int, height: int) -> "Box":
        """Return the part that lies in an image of `width` × `height` pixels."""
        return self.intersection(Box(0, 0, width, height))

    def iou(self, other: "Box") -> float:
        """Return intersection over union, 0 to 1; 0 where neither has an area."""
        common = self.intersection(other).area
        total = self.area + other.area - common
        return common / total if total else 0.0

    def gap(self, other: "Box") -> float:
        """Return the distance in pixels between the two outlines; 0 where they touch or overlap."""
        dx = max(self.x - other.right, other.x - self.right, 0)
        dy = max(self.y - other.bottom, other.y - self.bottom, 0)
        return math.hypot(dx, dy)


def iou_matrix(a: Float64Array, b: Float64Array) -> Float64Array:
    """Return intersection over union, 0 to 1, of every box of `a` with every box of `b`.

    Parameters
    ----------
    a, b
        Shapes `(n, 4)` and `(m, 4)`, each box with an area.

    Returns
    -------
    float64 of shape `(n, m)`; boxes that only touch have 0.
    """
    return iou(a[:, np.newaxis], b)


def iou(a: Float64Array, b: Float64Array) -> Float64Array:
    """Return intersection over union of boxes with an area, of shapes `(…, 4)` that broadcast."""
    common = _intersection(a, b)
    return common / (_area(a) + _area(b) - common)


def coverage(predicted: Float64Array, regions: Float64Array) -> Float64Array:
    """Return the share, 0 to 1, of every predicted box's own area that lies in every region.

    Parameters
    ----------
    predicted, regions
        Shapes `(n, 4)` and `(m, 4)`, each predicted box with an area.

    Returns
    -------
    float64 of shape `(n, m)`.
    """
    return _intersection(predicted[:, np.newaxis], regions) / _area(predicted)[:, np.newaxis]


def are_nested(boxes: Float64Array, scores: npt.ArrayLike) -> BoolArray:
    """Tell of each box whether it and a box with a higher score lie in one another.

    So it is where nearly all of the smaller one lies in the larger: at most one of them shows a
    vehicle.

    Parameters
    ----------
    boxes
        Shape `(n, 4)`, each with an area.
    scores
        Shape `(n,)`. Of equal scores, that of the larger box counts as higher.

    Returns
    -------
    bool `(n,)`.
    """
    inside = coverage(boxes, boxes) > _NESTED
    rank = np.empty(len(boxes), np.int64)
    rank[np.lexsort((_area(boxes), np.asarray(scores)))] = np.arange(len(boxes))
    higher = rank > rank[:, np.newaxis]
    return np.asarray(((inside | inside.T) & higher).any(axis=1))


def to_sides(corners: npt.NDArray[np.floating[Any]]) -> Float64Array:
    """Return boxes `(n, 4)` given by x1, y1, x2, y2 as x, y, width, height."""
    boxes = corners.astype(np.float64)
    boxes[:, 2:] -= boxes[:, :2]
    return boxes


def visible(boxes: Float64Array, size: tuple[int, int]) -> Float64Array:
    """Return the parts of boxes `(n, 4)` that lie in a frame of `size`; sides may be 0."""
    near = np.minimum(np.maximum(boxes[:, :2], 0), size)  # np.clip takes thrice as long
    far = np.minimum(np.maximum(boxes[:, :2] + boxes[:, 2:], 0), size)
    return np.concatenate([near, far - near], axis=1)


def _intersection(a: Float64Array, b: Float64Array) -> Float64Array:
    # One axis after the other, because NumPy is slow over a last axis of two.
    return _common(a[..., ::2], b[..., ::2]) * _common(a[..., 1::2], b[..., 1::2])


def _common(a: Float64Array, b: Float64Array) -> Float64Array:
    """Return the length, at least 0, that spans `(…, 2)` of start and length share."""
    near = np.maximum(a[..., 0], b[..., 0])
    shared = np.minimum(a[..., 0] + a[..., 1], b[..., 0] + b[..., 1]) - near
    return np.asarray(np.maximum(shared, 0, out=shared))


def _area(boxes: Float64Array) -> Float64Array:
    return np.asarray(boxes[..., 2] * boxes[..., 3])

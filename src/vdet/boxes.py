"""Boxes in an image: x1, y1, x2, y2 in pixels, x to the right, y down, far sides exclusive.

Boxes are rounded only where a format is written or pixels are cut or drawn. The array types are
here too.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, overload

import numpy as np
import numpy.typing as npt

from vdet.errors import ArgumentError, needing

if TYPE_CHECKING:
    import pandas as pd
    import supervision

Float32Array = npt.NDArray[np.float32]
Float64Array = npt.NDArray[np.float64]
Int32Array = npt.NDArray[np.int32]
Int64Array = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]
Image = npt.NDArray[np.uint8]

_Rows = slice | Sequence[int] | npt.NDArray[Any]

EDGE = 0.005
"""What is this near to a side of the frame lies on it, and a box is cut off: fraction of the frame.
"""
_MOVED, _SURELY = 0.2, 0.5
"""Minimum distance of what has moved from its first position, in its sizes; the second to be sure.

Boxes of what stands jitter by 0.03, or drift by 0.3 where something passes. If tracks were shown at
0.5, a lorry of a real clip that scores low would be too late to be counted; if vehicles were
counted at 0.2, parked ones would be.
"""
_NESTED = 0.8
"""Minimum fraction of a box inside another one that it is nested in."""


@dataclass(frozen=True, slots=True)
class Box:
    """One box, pixels: from the left side `x1` to the right side `x2`, from top `y1` to `y2`."""

    x1: float
    y1: float
    x2: float
    y2: float

    @classmethod
    def sized(cls, x: float, y: float, width: float, height: float) -> "Box":
        """Return the box with this top-left corner and size."""
        return cls(x, y, x + width, y + height)

    @classmethod
    def of(cls, sides: Iterable[float]) -> "Box":
        """Return the box with these sides: x1, y1, x2, y2."""
        x1, y1, x2, y2 = sides
        return cls(x1, y1, x2, y2)

    @property
    def width(self) -> float:
        """Pixels across."""
        return self.x2 - self.x1

    @property
    def height(self) -> float:
        """Pixels down."""
        return self.y2 - self.y1

    @property
    def area(self) -> float:
        """Square pixels; 0 for a box without width or height."""
        return max(0.0, self.width) * max(0.0, self.height)

    @property
    def size(self) -> float:
        """The mean of width and height."""
        return (self.width + self.height) / 2

    @property
    def center(self) -> tuple[float, float]:
        """The middle, `(x, y)`."""
        return (self.x1 + self.x2) / 2, (self.y1 + self.y2) / 2

    @property
    def foot(self) -> tuple[float, float]:
        """The middle of the lower edge, `(x, y)`."""
        return (self.x1 + self.x2) / 2, float(self.y2)

    @property
    def rounded(self) -> "Box":
        """The box with its sides at the nearest whole pixels, halves up."""
        return Box.of(self.pixels)

    @property
    def pixels(self) -> tuple[int, int, int, int]:
        """x1, y1, x2, y2 as whole pixels, halves up."""
        up, down = math.floor(self.y1 + 0.5), math.floor(self.y2 + 0.5)
        return math.floor(self.x1 + 0.5), up, math.floor(self.x2 + 0.5), down

    @property
    def xywh(self) -> tuple[int, int, int, int]:
        """x, y, width, height for files: the sides as whole pixels, at least one apart."""
        x1, y1, x2, y2 = self.pixels
        return x1, y1, max(1, x2 - x1), max(1, y2 - y1)

    def cut_by(self, size: tuple[float, float]) -> "CutSides":
        """Return which of its sides a frame of `size`, width and height, cuts off."""
        return cut_sides((self.x1, self.y1, self.x2, self.y2), size)

    def cut(self, image: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Return a view of the whole pixels of an image `(H, W, …)` in the box, clipped to it."""
        x1, y1, x2, y2 = (max(0, side) for side in self.pixels)
        return image[y1:y2, x1:x2]

    def contains(self, point: tuple[float, float]) -> bool:
        """Return whether `point`, `(x, y)`, lies in the box."""
        x, y = point
        return self.x1 <= x < self.x2 and self.y1 <= y < self.y2

    def union(self, other: "Box") -> "Box":
        """Return the smallest box that covers both."""
        x1, y1 = min(self.x1, other.x1), min(self.y1, other.y1)
        return Box(x1, y1, max(self.x2, other.x2), max(self.y2, other.y2))

    def intersection(self, other: "Box") -> "Box":
        """Return the intersection; its area is 0 if they do not overlap."""
        x1, y1 = max(self.x1, other.x1), max(self.y1, other.y1)
        return Box(x1, y1, max(x1, min(self.x2, other.x2)), max(y1, min(self.y2, other.y2)))

    def clipped(self, width: float, height: float) -> "Box":
        """Return the part inside an image of `width` × `height` pixels."""
        return self.intersection(Box(0, 0, width, height))

    def iou(self, other: "Box") -> float:
        """Return intersection over union, 0 to 1; 0 if neither has an area."""
        common = self.intersection(other).area
        total = self.area + other.area - common
        return common / total if total else 0.0

    def gap(self, other: "Box") -> float:
        """Return the distance in pixels between the two outlines; 0 where they touch or overlap."""
        dx = max(self.x1 - other.x2, other.x1 - self.x2, 0)
        dy = max(self.y1 - other.y2, other.y1 - self.y2, 0)
        return math.hypot(dx, dy)


@dataclass(frozen=True, slots=True)
class Detection:
    """One row of `Boxes`; `class_name` and `id` are None if unknown."""

    box: Box
    score: float
    class_name: str | None = None
    id: int | None = None


@dataclass(frozen=True, slots=True, eq=False, init=False)
class Boxes:
    """Scored boxes of one image in columns of `n` rows, immutable; detectors return it.

    Attributes
    ----------
    sides
        float64 `(n, 4)`: x1, y1, x2, y2 in pixels of the frame; x to the right, y down, `x2` and
        `y2` are exclusive.
    scores
        float64 `(n,)`, 0 to 1: the fraction of boxes with this score that are vehicles.
    classes
        int32 `(n,)`: indices into `names`; None if classes are unknown.
    names
        The names of all classes.
    ids
        int64 `(n,)`: the id of each vehicle; None if unknown.
    data
        Further columns of `n` rows by name, float64. Trackers use `class_scores`
        `(n, len(names))`, the probability of each class; the rules tracker also uses
        `centroid` `(n, 2)`, x and y, and `strength` `(n,)`.
    trace
        What the detector needs for its stage images; not used elsewhere.

    Raises
    ------
    ArgumentError
        A column has the wrong shape, a value is not finite, a box has no area, a score is not from
        0 to 1, or a class has no name.
    """

    sides: Float64Array
    scores: Float64Array
    classes: Int32Array | None
    names: tuple[str, ...]
    ids: Int64Array | None
    data: Mapping[str, Float64Array]
    trace: Any = field(repr=False)

    def __init__(
        self,
        sides: npt.ArrayLike,
        scores: npt.ArrayLike,
        *,
        classes: npt.ArrayLike | None = None,
        names: Sequence[str] = (),
        ids: npt.ArrayLike | None = None,
        data: Mapping[str, npt.ArrayLike] = MappingProxyType({}),
        trace: Any = None,
    ) -> None:
        put = partial(object.__setattr__, self)  # the class is frozen
        rows = np.atleast_1d(sides).shape[:1]
        put("sides", _column(sides, np.float64, (*rows, 4), "sides"))
        put("scores", _column(scores, np.float64, rows, "scores"))
        put("classes", _column(classes, np.int32, rows, "classes"))
        put("names", tuple(names))
        put("ids", _column(ids, np.int64, rows, "ids"))
        shapes = {name: (*rows, *np.shape(values)[1:]) for name, values in data.items()}
        put("data", {n: _column(data[n], np.float64, shape, n) for n, shape in shapes.items()})
        put("trace", trace)
        if (self.sides[:, 2:] <= self.sides[:, :2]).any():
            raise ArgumentError("sides: a box has no area; must be x1 < x2 and y1 < y2")
        if ((self.scores < 0) | (self.scores > 1)).any():
            raise ArgumentError("scores: must be from 0 to 1")
        if self.classes is not None and not np.isin(self.classes, range(len(names))).all():
            raise ArgumentError("classes: an index is not in `names`")
        if self.data.get("class_scores", np.empty((0, len(names)))).shape[1:] != (len(names),):
            raise ArgumentError("class_scores: must have a column for each of `names`")

    def __len__(self) -> int:
        return len(self.sides)

    def __iter__(self) -> Iterator[Detection]:
        ids = [None] * len(self) if self.ids is None else self.ids.tolist()
        scores, names = self.scores.tolist(), self.class_names
        for sides, score, name, number in zip(self.sides.tolist(), scores, names, ids, strict=True):
            yield Detection(Box.of(sides), score, name, number)

    @overload
    def __getitem__(self, rows: int) -> Detection: ...
    @overload
    def __getitem__(self, rows: _Rows) -> "Boxes": ...
    def __getitem__(self, rows: int | _Rows) -> "Detection | Boxes":
        """Return one row, or these rows in this order with the same `names` and `trace`."""
        if isinstance(rows, int | np.integer):
            return next(iter(self[[int(rows)]]))
        if not isinstance(rows, slice):
            rows = np.asarray(rows) if len(rows) else slice(0)  # an empty array has floats
        return Boxes(
            self.sides[rows],
            self.scores[rows],
            classes=None if self.classes is None else self.classes[rows],
            names=self.names,
            ids=None if self.ids is None else self.ids[rows],
            data={name: column[rows] for name, column in self.data.items()},
            trace=self.trace,
        )

    @property
    def class_names(self) -> list[str | None]:
        """The class name of each box; None if classes are unknown."""
        if self.classes is None:
            return [None] * len(self)
        return [self.names[number] for number in self.classes.tolist()]

    def reach(self, minimum: float, by_class: Mapping[str, float]) -> BoolArray:
        """Return for each box, `(n,)`, whether its score is at least the minimum of its class.

        That is `minimum` for a class without one in `by_class`.
        """
        minima = [by_class.get(name or "", minimum) for name in self.class_names]
        return np.asarray(self.scores >= np.array(minima))

    @property
    def likely_classes(self) -> list[dict[str, float]]:
        """For each box the probability of each class, 0 to 1; empty if classes are unknown."""
        if "class_scores" in self.data:
            rows = self.data["class_scores"].tolist()
            return [dict(zip(self.names, row, strict=True)) for row in rows]
        return [{} if name is None else {name: 1.0} for name in self.class_names]

    def to_supervision(self) -> "supervision.Detections":
        """Return a `supervision.Detections` with copies; needs the package supervision."""
        with needing("notebook"):
            import supervision

        names = {} if self.classes is None else {"class_name": np.array(self.class_names)}
        return supervision.Detections(
            xyxy=self.sides.copy(),
            confidence=self.scores.copy(),
            class_id=None if self.classes is None else self.classes.astype(int),
            tracker_id=None if self.ids is None else self.ids.copy(),
            data=names | {name: column.copy() for name, column in self.data.items()},
            metadata={"class_names": self.names},
        )

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table with a row for each box; needs the package pandas.

        Its columns are x1, y1, x2, y2, score, class_name, id, and those of `data`.
        """
        with needing("notebook"):
            import pandas as pd

        columns: dict[str, Any] = dict(zip(("x1", "y1", "x2", "y2"), self.sides.T, strict=True))
        columns |= {"score": self.scores, "class_name": self.class_names, "id": self.ids}
        for name, data in self.data.items():
            parts = {f"{name}_{number}": part for number, part in enumerate(data.T)}
            columns |= {name: data} if data.ndim == 1 else parts
        return pd.DataFrame(columns)


def _column(
    values: npt.ArrayLike | None, kind: type[np.generic], shape: tuple[int, ...], name: str
) -> Any:
    """Return a read-only copy of this shape; None for None."""
    if values is None:
        return None
    column = np.array(values, kind)
    if not column.size and 0 in shape:
        column = column.reshape(shape)
    if column.shape != shape:
        raise ArgumentError(f"{name}: has shape {column.shape}, expected {shape}")
    if not np.isfinite(column).all():
        raise ArgumentError(f"{name}: a value is not a finite number")
    column.flags.writeable = False
    return column


class CutSides(NamedTuple):
    """Whether the frame cuts off the sides of a box, or of `n` boxes, bool `(n,)`."""

    left: Any
    top: Any
    right: Any
    bottom: Any

    @property
    def hide_foot(self) -> Any:
        """Whether the ground point is not known: the lower edge is not seen, or not all of it."""
        return self.left | self.right | self.bottom


def cut_sides(sides: Iterable[Any], size: tuple[float, float]) -> CutSides:
    """Return which sides of a box a frame of `size`, width and height, cuts off.

    `sides` are x1, y1, x2, y2, each a number or an array of `n` of them.
    """
    (x1, y1, x2, y2), (width, height) = sides, size
    across, down = EDGE * width, EDGE * height
    return CutSides(x1 <= across, y1 <= down, x2 >= width - across, y2 >= height - down)


def has_moved(distance: float, size: float, *, surely: bool = False) -> bool:
    """Return whether a vehicle of a size has moved, at a distance from its first position."""
    return distance >= (_SURELY if surely else _MOVED) * size


NO_BOXES = Boxes(np.empty((0, 4)), np.empty(0))


def from_xywh(xywh: npt.NDArray[Any]) -> Float64Array:
    """Convert boxes `(n, 4)` from x, y, width, height to x1, y1, x2, y2."""
    sides = xywh.astype(np.float64)
    sides[:, 2:] += sides[:, :2]
    return sides


def iou_matrix(a: Float64Array, b: Float64Array) -> Float64Array:
    """Return intersection over union, 0 to 1, of every box of `a` with every box of `b`.

    Parameters
    ----------
    a, b
        x1, y1, x2, y2 of shapes `(n, 4)` and `(m, 4)`, each box with an area.

    The result is float64 `(n, m)`; 0 for boxes that only touch.
    """
    return iou(a[:, np.newaxis], b)


def iou(a: Float64Array, b: Float64Array) -> Float64Array:
    """Return intersection over union of boxes with an area, of shapes `(…, 4)` that broadcast."""
    common = _intersection(a, b)
    return common / (area(a) + area(b) - common)


def coverage(boxes: Float64Array, others: Float64Array) -> Float64Array:
    """Return the fraction of the area of each box that is inside each of the others, `(n, m)`.

    `boxes` and `others` are x1, y1, x2, y2 of shapes `(n, 4)` and `(m, 4)`; `boxes` have an area.
    """
    return _intersection(boxes[:, np.newaxis], others) / area(boxes)[:, np.newaxis]


def are_nested(boxes: Float64Array, scores: npt.ArrayLike) -> BoolArray:
    """Return for each box, `(n,)`, whether it contains, or is inside, a box with a higher score.

    Nearly all of the smaller one is then inside the larger: at most one of them shows a vehicle.

    Parameters
    ----------
    boxes
        x1, y1, x2, y2 of shape `(n, 4)`, each with an area.
    scores
        Shape `(n,)`. Of two equal scores, the one of the larger box counts as higher.
    """
    inside = coverage(boxes, boxes) > _NESTED
    rank = np.empty(len(boxes), np.int64)
    rank[np.lexsort((area(boxes), np.asarray(scores)))] = np.arange(len(boxes))
    higher = rank > rank[:, np.newaxis]
    return np.asarray(((inside | inside.T) & higher).any(axis=1))


def clipped(boxes: Float64Array, size: tuple[int, int]) -> Float64Array:
    """Clip boxes `(n, 4)` to a frame of `size`, width and height; they may lose their area."""
    return np.minimum(np.maximum(boxes, 0), (*size, *size))  # np.clip is three times slower


def area(boxes: Float64Array) -> Float64Array:
    """Return the areas of boxes `(…, 4)` in square pixels."""
    return np.asarray((boxes[..., 2] - boxes[..., 0]) * (boxes[..., 3] - boxes[..., 1]))


def _intersection(a: Float64Array, b: Float64Array) -> Float64Array:
    # One axis after the other, because NumPy is slow over a last axis of two.
    return _common(a[..., ::2], b[..., ::2]) * _common(a[..., 1::2], b[..., 1::2])


def _common(a: Float64Array, b: Float64Array) -> Float64Array:
    """Return the length of the overlap of spans `(…, 2)`, near and far end, at least 0."""
    shared = np.minimum(a[..., 1], b[..., 1]) - np.maximum(a[..., 0], b[..., 0])
    return np.asarray(np.maximum(shared, 0))

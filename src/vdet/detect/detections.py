"""What a detector finds in one frame: a table with a row for each vehicle."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from vdet.boxes import Box, Float32Array, Int32Array

if TYPE_CHECKING:
    import supervision


@dataclass(frozen=True, slots=True, eq=False, init=False)
class Detections:
    """The vehicles that a detector finds in a frame: `n` rows, immutable.

    Attributes
    ----------
    boxes
        float32 `(n, 4)`: x1, y1, x2, y2 in pixels of the frame; x to the right, y down, `x2` and
        `y2` are the far sides, exclusive.
    scores
        float32 `(n,)`, 0 to 1: the share of boxes with such a score that are vehicles.
    classes
        int32 `(n,)`: indices into `names`; None where the detector does not tell classes.
    names
        The names of all classes.
    centroids
        float32 `(n, 2)`: x, y of the centre of mass, pixels of the frame; by default the middle of
        the box.
    strengths
        float32 `(n,)`: how strong the evidence is, in the detector's own unit; by default the
        score.
    trace
        What the detector needs for its stage pictures; of no use to others.

    Raises
    ------
    ValueError
        A column has another shape, a value is not finite, a box has no area, a score is not in
        0 to 1, a class has no name.
    """

    boxes: Float32Array
    scores: Float32Array
    classes: Int32Array | None
    names: tuple[str, ...]
    centroids: Float32Array
    strengths: Float32Array
    trace: Any = field(repr=False)

    def __init__(
        self,
        boxes: npt.ArrayLike,
        scores: npt.ArrayLike,
        *,
        classes: npt.ArrayLike | None = None,
        names: Sequence[str] = (),
        centroids: npt.ArrayLike | None = None,
        strengths: npt.ArrayLike | None = None,
        trace: Any = None,
    ) -> None:
        box_column = _column(boxes, np.float32, (-1, 4), "boxes")
        count = len(box_column)
        score_column = _column(scores, np.float32, (count,), "scores")
        class_column = None if classes is None else _column(classes, np.int32, (count,), "classes")
        if ((box_column[:, 2:] - box_column[:, :2]) <= 0).any():
            raise ValueError("boxes: a box has no area; give x1 < x2 and y1 < y2")
        if ((score_column < 0) | (score_column > 1)).any():
            raise ValueError("scores: a score is not in 0 to 1")
        if class_column is not None and ((class_column < 0) | (class_column >= len(names))).any():
            raise ValueError("classes: an index that `names` does not have")
        if centroids is None:
            centroids = (box_column[:, :2] + box_column[:, 2:]) / 2
        if strengths is None:
            strengths = score_column
        columns = {
            "boxes": box_column,
            "scores": score_column,
            "classes": class_column,
            "names": tuple(names),
            "centroids": _column(centroids, np.float32, (count, 2), "centroids"),
            "strengths": _column(strengths, np.float32, (count,), "strengths"),
            "trace": trace,
        }
        for name, column in columns.items():
            object.__setattr__(self, name, column)

    def __len__(self) -> int:
        return len(self.boxes)

    def __getitem__(self, rows: slice | Sequence[int] | npt.NDArray[Any]) -> "Detections":
        """Return these rows in this order, with the same `names` and `trace`."""
        if not isinstance(rows, slice):
            rows = np.asarray(rows) if len(rows) else slice(0)  # an empty array is one of floats
        return Detections(
            self.boxes[rows],
            self.scores[rows],
            classes=None if self.classes is None else self.classes[rows],
            names=self.names,
            centroids=self.centroids[rows],
            strengths=self.strengths[rows],
            trace=self.trace,
        )

    @property
    def rounded(self) -> list[Box]:
        """The boxes to the nearest whole pixel, halves up."""
        return [
            Box(x1, y1, x2 - x1, y2 - y1)
            for x1, y1, x2, y2 in np.floor(self.boxes + 0.5).astype(int).tolist()
        ]

    @property
    def class_names(self) -> list[str | None]:
        """The name of each box's class; None for all where the detector does not tell classes."""
        if self.classes is None:
            return [None] * len(self)
        return [self.names[number] for number in self.classes.tolist()]

    def to_supervision(self) -> "supervision.Detections":
        """Return a `supervision.Detections` with copies; needs the package supervision."""
        import supervision

        return supervision.Detections(
            xyxy=self.boxes.copy(),
            confidence=self.scores.copy(),
            class_id=None if self.classes is None else self.classes.astype(int),
            data={} if self.classes is None else {"class_name": np.array(self.class_names)},
        )


def _column(
    values: npt.ArrayLike, kind: type[np.generic], shape: tuple[int, ...], name: str
) -> npt.NDArray[Any]:
    """Return a read-only copy; -1 in `shape` stands for any length."""
    column = np.array(values, kind)
    if column.size == 0 and shape[0] <= 0:
        column = column.reshape(0, *shape[1:])
    if column.ndim != len(shape) or any(
        wanted not in (-1, length) for wanted, length in zip(shape, column.shape, strict=True)
    ):
        raise ValueError(f"{name}: of shape {column.shape}, expected {shape}")
    if not np.isfinite(column).all():
        raise ValueError(f"{name}: a value is not a finite number")
    column.flags.writeable = False
    return column


NO_DETECTIONS = Detections(np.empty((0, 4)), np.empty(0))

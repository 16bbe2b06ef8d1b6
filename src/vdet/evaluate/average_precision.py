"""How well vehicles are found at every score, without regard to their ids."""

from dataclasses import dataclass

import numpy as np

from vdet.boxes import BoolArray, Float64Array
from vdet.evaluate.comparison import ComparedFrame, Comparison

IOU_THRESHOLDS = np.linspace(0.5, 0.95, 10)

_RECALLS = np.linspace(0, 1, 101)


@dataclass(frozen=True, slots=True, eq=False)
class RankedPredictions:
    """All predictions by descending score, and which of them are right.

    Each finds the vehicle of its frame that it overlaps most among those that no prediction before
    it has found. Those of equal score are taken in the order of the frames, so that without scores
    they describe a single operating point.
    Source: the COCO detection evaluation (pycocotools).

    Attributes
    ----------
    scores
        float64 `(n,)`, descending.
    right
        bool `(10, n)`: whether each finds a vehicle, at each of `IOU_THRESHOLDS`.
    vehicles
        Number of true boxes.
    """

    scores: Float64Array
    right: BoolArray
    vehicles: int

    def average_precisions(self) -> tuple[float, float]:
        """Return the average precision at IoU 0.5, and its mean over `IOU_THRESHOLDS`, 0 to 1.

        It is the mean of the precision at the 101 recalls 0, 0.01 … 1; 0 if there are no vehicles.
        """
        if not self.vehicles or not len(self.scores):
            return 0.0, 0.0
        precisions = [_average_precision(row, self.vehicles) for row in self.right]
        return precisions[0], float(np.mean(precisions))

    def f1_curve(self) -> tuple[Float64Array, Float64Array]:
        """Return each score, descending, and F1 where it is the lowest that counts.

        float64 `(k,)` each; without a point if there are no vehicles.
        """
        f1 = 2 * np.cumsum(self.right[0]) / (np.arange(len(self.scores)) + 1 + self.vehicles)
        last = np.append(self.scores[1:] != self.scores[:-1], True)[: len(self.scores)]
        last &= self.vehicles > 0
        return self.scores[last], f1[last]

    def f1_at(self, scores: Float64Array) -> Float64Array:
        """Return F1 where predictions with at least each of these scores count."""
        known, f1 = self.f1_curve()
        return np.concatenate([[0.0], f1])[np.searchsorted(-known, -scores, side="right")]


def rank_predictions(comparison: Comparison) -> RankedPredictions:
    """Sort the predictions by descending score, and mark those that are right."""
    none = np.zeros((len(IOU_THRESHOLDS), 0), np.bool_)
    frames = comparison.frames
    scores = np.concatenate([np.empty(0), *(np.sort(-frame.scores) for frame in frames)])
    right = np.concatenate([none, *map(_right_predictions, frames)], axis=1)
    order = np.argsort(scores, kind="stable")
    vehicles = sum(len(frame.vehicles) for frame in frames)
    return RankedPredictions(-scores[order], right[:, order], vehicles)


def _right_predictions(frame: ComparedFrame) -> BoolArray:
    """Return whether each prediction finds a vehicle, `(10, m)`: by threshold and score."""
    order = np.argsort(-frame.scores, kind="stable")
    right = np.zeros((len(IOU_THRESHOLDS), len(order)), np.bool_)
    overlaps = frame.iou[:, order]
    for row, threshold in zip(right, IOU_THRESHOLDS, strict=True):
        free = overlaps.copy()
        for column in np.flatnonzero(overlaps.max(axis=0, initial=0) >= threshold).tolist():
            best = len(free) - 1 - int(np.argmax(free[::-1, column]))  # the last of equals: COCO
            if free[best, column] >= threshold:
                row[column] = True
                free[best] = -1
    return right


def _average_precision(right: BoolArray, vehicles: int) -> float:
    found = np.cumsum(right)
    recall = found / vehicles
    precision = found / np.arange(1, len(right) + 1)
    highest_from_here = np.maximum.accumulate(precision[::-1])[::-1]
    reached = np.searchsorted(recall, _RECALLS, side="left")
    return float(np.append(highest_from_here, 0)[reached].mean())

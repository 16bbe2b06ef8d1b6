"""Average precision as COCO has it.

Source: the COCO detection evaluation (pycocotools): at each IoU threshold predictions are taken
from the surest to the least sure, each finds the free vehicle of its frame that it overlaps most,
and the precision at 101 recalls 0, 0.01 … 1 is averaged.
"""

import numpy as np
import numpy.typing as npt

from vdet.evaluate.comparison import ComparedFrame, Comparison
from vdet.geometry import Float64Array

IOU_THRESHOLDS = np.linspace(0.5, 0.95, 10)

_RECALLS = np.linspace(0, 1, 101)


def average_precisions(comparison: Comparison) -> Float64Array:
    """Return the average precision at each of `IOU_THRESHOLDS`, float64 `(10,)`, 0 to 1.

    Predictions of equal score are taken in the order of the frames. Where no track file gives
    scores this makes AP a summary of one working point only. 0 where there are no vehicles.
    """
    vehicles = int(comparison.vehicle_lengths().sum())
    if not vehicles or not len(comparison.track_ids):
        return np.zeros(len(IOU_THRESHOLDS))
    scores = np.concatenate([np.sort(-frame.scores) for frame in comparison.frames])
    found = np.concatenate([_found(frame) for frame in comparison.frames], axis=1)
    order = np.argsort(scores, kind="stable")
    return np.array([_average_precision(row[order], vehicles) for row in found])


def _found(frame: ComparedFrame) -> npt.NDArray[np.bool_]:
    """Tell for each threshold, and each prediction from the surest on, whether it finds one."""
    order = np.argsort(-frame.scores, kind="stable")
    found = np.zeros((len(IOU_THRESHOLDS), len(order)), np.bool_)
    for row, threshold in zip(found, IOU_THRESHOLDS, strict=True):
        free = frame.iou[:, order].copy()
        for column in range(len(order)):
            row[column] = _take(free, column, threshold)
    return found


def _take(free: Float64Array, column: int, threshold: float) -> bool:
    """Give the prediction its best vehicle, if any is left, and strike that from `free`."""
    if not len(free):
        return False
    best = len(free) - 1 - int(np.argmax(free[::-1, column]))  # of equals the last, as COCO
    if free[best, column] < threshold:
        return False
    free[best] = -1
    return True


def _average_precision(found: npt.NDArray[np.bool_], vehicles: int) -> float:
    right = np.cumsum(found)
    recall = right / vehicles
    precision = right / np.arange(1, len(found) + 1)
    highest_from_here = np.maximum.accumulate(precision[::-1])[::-1]
    reached = np.searchsorted(recall, _RECALLS, side="left")
    return float(np.append(highest_from_here, 0)[reached].mean())

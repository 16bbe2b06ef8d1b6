"""One box for each vehicle, of the boxes of one search or of two."""

import cv2
import numpy as np

from vdet.boxes import Float32Array, Int64Array, iou_matrix
from vdet.detect.onnx.layouts import RawBoxes

_MAX_BOXES = 10_000  # before suppression, those of the highest scores

_SAME_IOU = 0.5
"""Minimum overlap of the boxes of two searches that show one vehicle."""

_BOTH = 1.65
"""Odds of a box that both searches found, as a multiple of the mean odds of the two."""


def suppress(found: RawBoxes, overlap: float) -> RawBoxes:
    """Return the boxes that are kept, the best first.

    A box is removed if its intersection over union with a better one exceeds `overlap`.
    """
    near, far = found.boxes[:, :2], found.boxes[:, 2:]
    places = np.concatenate([near, far - near], axis=1, dtype=np.float64)
    kept = cv2.dnn.NMSBoxes(places.tolist(), found.scores.tolist(), 0.0, overlap, top_k=_MAX_BOXES)
    return found.rows(np.asarray(kept, np.int64).reshape(-1))


def combine(first: RawBoxes, second: RawBoxes, overlap: float) -> RawBoxes:
    """Return the boxes of two searches of one picture, the best first; both have `class_scores`.

    Two boxes that overlap each other the most become their mean, weighted by score. Its score is
    the geometric mean of the odds of both, raised by a constant; a box that one search did not find
    keeps half its score. With both rules, fitted to cameras that were held out from a training, the
    score stays the fraction of boxes that are right. Then a box is removed if its intersection over
    union with a better one exceeds `overlap`, or that of boxes of one vehicle.

    Source: Solovyev, Wang and Gabruseva, "Weighted boxes fusion: Ensembling boxes from different
    object detection models", 2021.
    """
    assert first.class_scores is not None
    assert second.class_scores is not None
    rows, columns = _pairs(first.boxes, second.boxes)
    one, other = first.scores[rows], second.scores[columns]
    weights = (other / (one + other))[:, np.newaxis]
    right, wrong = _BOTH * np.sqrt(one * other), np.sqrt((1 - one) * (1 - other))

    def joined(values: Float32Array, others: Float32Array) -> Float32Array:
        means = values.copy()
        means[rows] += weights * (others[columns] - values[rows])
        return np.concatenate([means, np.delete(others, columns, axis=0)])

    scores = np.concatenate([first.scores, np.delete(second.scores, columns)]) * np.float32(0.5)
    scores[rows] = right / (right + wrong)
    likely = joined(first.class_scores, second.class_scores)
    classes = likely.argmax(axis=1).astype(np.int32)
    found = RawBoxes(joined(first.boxes, second.boxes), scores, classes, likely)
    return suppress(found, min(overlap, _SAME_IOU))


def _pairs(boxes: Float32Array, others: Float32Array) -> tuple[Int64Array, Int64Array]:
    """Return the rows of both lists whose boxes overlap each other the most."""
    if not (len(boxes) and len(others)):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    ious = iou_matrix(boxes.astype(np.float64), others.astype(np.float64))
    columns = ious.argmax(axis=1)
    rows = np.arange(len(boxes))
    is_pair = (ious.argmax(axis=0)[columns] == rows) & (ious[rows, columns] >= _SAME_IOU)
    return rows[is_pair], columns[is_pair]

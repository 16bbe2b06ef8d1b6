"""One box for each vehicle, of the boxes of one search or of two."""

from typing import Any

import cv2
import numpy as np

from vdet.boxes import Boxes, Float64Array, Int64Array, iou_matrix

_MAX_BOXES = 10_000  # before suppression, those of the highest scores

_SAME_IOU = 0.5
"""Minimum overlap of the boxes of two searches that show one vehicle."""

_BOTH = 1.65
"""Odds of a box that both searches found, as a multiple of the mean odds of the two."""


def suppress(boxes: Boxes, overlap: float) -> Boxes:
    """Return the boxes that are kept, the best first.

    A box is removed if its intersection over union with a better one exceeds `overlap`.
    """
    scores: Any = boxes.scores  # typed as a list, like the boxes
    xywh: Any = boxes.sides.copy()
    xywh[:, 2:] -= xywh[:, :2]
    kept = cv2.dnn.NMSBoxes(xywh, scores, 0.0, overlap, top_k=_MAX_BOXES)
    return boxes[np.asarray(kept, np.int64)]


def combine(first: Boxes, second: Boxes, overlap: float) -> Boxes:
    """Return the boxes of two searches of one picture, the best first; both have `class_scores`.

    Two boxes that overlap each other the most become their mean, weighted by score. Its score is
    the geometric mean of the odds of both, raised by a constant; a box that one search did not find
    keeps half its score. With both rules, fitted to cameras that were held out from a training run,
    the score stays the fraction of boxes that are right. Then a box is removed if its intersection
    over union with a better one exceeds `overlap`, or that of boxes of one vehicle.

    Source: Solovyev, Wang and Gabruseva, "Weighted boxes fusion: Ensembling boxes from different
    object detection models", 2021.
    """
    rows, columns = _pairs(first.sides, second.sides)
    a, b = first.scores[rows], second.scores[columns]
    weights = (b / (a + b))[:, np.newaxis]
    right, wrong = _BOTH * np.sqrt(a * b), np.sqrt((1 - a) * (1 - b))

    def merged(of_first: Float64Array, of_second: Float64Array) -> Float64Array:
        means = of_first.copy()
        means[rows] += weights * (of_second[columns] - of_first[rows])
        return np.concatenate([means, np.delete(of_second, columns, axis=0)])

    scores = np.concatenate([first.scores, np.delete(second.scores, columns)]) / 2
    scores[rows] = right / (right + wrong)
    class_scores = merged(first.data["class_scores"], second.data["class_scores"])
    boxes = Boxes(
        merged(first.sides, second.sides),
        scores,
        classes=class_scores.argmax(axis=1),
        names=first.names,
        data={"class_scores": class_scores},
    )
    return suppress(boxes, min(overlap, _SAME_IOU))


def _pairs(first: Float64Array, second: Float64Array) -> tuple[Int64Array, Int64Array]:
    """Return the rows of both lists whose boxes overlap each other the most."""
    if not (len(first) and len(second)):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    ious = iou_matrix(first, second)
    columns = ious.argmax(axis=1)
    rows = np.arange(len(first))
    is_pair = (ious.argmax(axis=0)[columns] == rows) & (ious[rows, columns] >= _SAME_IOU)
    return rows[is_pair], columns[is_pair]

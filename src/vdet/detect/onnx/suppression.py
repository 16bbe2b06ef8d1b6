"""One box for each vehicle: weaker boxes that overlap a stronger one are removed."""

import cv2
import numpy as np

from vdet.boxes import Float32Array, Int64Array, to_sides


def suppress(boxes: Float32Array, scores: Float32Array, overlap: float) -> Int64Array:
    """Return the rows of the boxes that stay, the best first.

    Parameters
    ----------
    boxes
        float32 `(n, 4)`: x1, y1, x2, y2.
    scores
        float32 `(n,)`.
    overlap
        A box with more intersection over union with a better one is removed.
    """
    kept = cv2.dnn.NMSBoxes(to_sides(boxes).tolist(), scores.tolist(), 0.0, overlap)
    return np.asarray(kept, np.int64).reshape(-1)

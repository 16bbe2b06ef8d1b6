"""Overlap of many boxes with many; each is `x, y, width, height` in pixels, float64."""

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def iou_matrix(a: Floats, b: Floats) -> Floats:
    """Return intersection over union, 0 to 1, of every box of `a` with every box of `b`.

    Parameters
    ----------
    a, b
        Shapes `(n, 4)` and `(m, 4)`, each box with an area.

    Returns
    -------
    float64 of shape `(n, m)`; boxes that only touch have 0.
    """
    common = _intersection(a, b)
    return common / (_area(a)[:, np.newaxis] + _area(b)[np.newaxis, :] - common)


def coverage(predicted: Floats, regions: Floats) -> Floats:
    """Return the share, 0 to 1, of every predicted box's own area that lies in every region.

    Parameters
    ----------
    predicted, regions
        Shapes `(n, 4)` and `(m, 4)`, each predicted box with an area.

    Returns
    -------
    float64 of shape `(n, m)`.
    """
    return _intersection(predicted, regions) / _area(predicted)[:, np.newaxis]


def visible(boxes: Floats, size: tuple[int, int]) -> Floats:
    """Return the parts of boxes `(n, 4)` that lie in a frame of `size`; sides may be 0."""
    near = np.clip(boxes[:, :2], 0, size)
    far = np.clip(boxes[:, :2] + boxes[:, 2:], 0, size)
    return np.concatenate([near, far - near], axis=1)


def _intersection(a: Floats, b: Floats) -> Floats:
    first, second = a[:, np.newaxis, :], b[np.newaxis, :, :]
    near = np.maximum(first[..., :2], second[..., :2])
    far = np.minimum(first[..., :2] + first[..., 2:], second[..., :2] + second[..., 2:])
    sides = np.maximum(far - near, 0)
    return np.asarray(sides[..., 0] * sides[..., 1])


def _area(boxes: Floats) -> Floats:
    return np.asarray(boxes[:, 2] * boxes[:, 3])

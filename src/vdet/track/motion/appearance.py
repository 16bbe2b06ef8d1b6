"""What vehicles look like: the mean colours of their upper and their lower half."""

import cv2
import numpy as np

from vdet.boxes import Float64Array, Image
from vdet.media import Picture

_MARGIN = 0.15
"""Fraction of a box's width and height at each side that is left out: much of it is background."""

_UNITS = 20.0, 6.0, 6.0
"""Differences of luma, blue and red chroma, in levels, that count as one.

Maximum number of vehicles differ by more from each other, and by less from themselves a second
before.
"""


def appearances(picture: Picture | None, boxes: Float64Array) -> Float64Array:
    """Return the mean luma, blue and red chroma of the upper and the lower half of each box.

    Parameters
    ----------
    picture
        None where it is not known.
    boxes
        float64 `(n, 4)`: x1, y1, x2, y2 in pixels, inside the picture, with an area.

    Returns
    -------
    float64 `(n, 2, 3)`: levels from 0 to 255, as the planes hold them; NaN without a picture.
    """
    if picture is None or not len(boxes):
        return np.full((len(boxes), 2, 3), np.nan)
    sides = _MARGIN * (boxes[:, 2:] - boxes[:, :2])
    inner = boxes + np.concatenate([sides, -sides], axis=1)
    halves = np.stack([inner, inner], axis=1)
    halves[:, 0, 3] = halves[:, 1, 1] = inner[:, [1, 3]].mean(axis=1)
    means = [_mean(picture, half) for half in halves.reshape(-1, 4)]
    return np.reshape(means, (-1, 2, 3))


def differences(some: Float64Array, others: Float64Array) -> Float64Array:
    """Return how much appearances, `(…, 2, 3)`, differ: 0 for equal ones, and for unknown ones."""
    shares = (some - others) / _UNITS
    return np.asarray(np.sqrt(np.nan_to_num(shares**2).mean(axis=(-2, -1))))


def _mean(picture: Picture, box: Float64Array) -> list[float]:
    planes = picture.planes
    if planes is None:
        blue, green, red, _ = cv2.mean(_part(picture.image, box))
        luma = 0.114 * blue + 0.587 * green + 0.299 * red  # ITU-R BT.601
        return [luma, 128 + 0.564 * (blue - luma), 128 + 0.713 * (red - luma)]
    layers = zip(planes.layers, (1, 2, 2), strict=True)
    return [cv2.mean(_part(layer, box / scale))[0] for layer, scale in layers]


def _part(image: Image, box: Float64Array) -> Image:
    """Return the pixels in a box, at least one."""
    x1, y1, x2, y2 = box.tolist()
    x, y = min(int(x1), image.shape[1] - 1), min(int(y1), image.shape[0] - 1)
    return image[y : max(round(y2), y + 1), x : max(round(x2), x + 1)]

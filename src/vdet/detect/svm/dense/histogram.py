"""The colour histogram's part of a linear score: look-up tables and integral images.

Each pixel adds the weights of its bins, so a window's part is the sum of a table over its pixels.
"""

import cv2
import numpy as np
import numpy.typing as npt

from vdet.geometry import Float32Array
from vdet.media.images import Image

Positions = npt.NDArray[np.intp]


def table_sums(
    strip: Image, tables: Float32Array, side: int, x: Positions, y: Positions
) -> Float32Array:
    """Sum tables over square windows.

    Parameters
    ----------
    strip
        uint8 `(h, w, 3)`.
    tables
        float32 `(m, 256, 3)`.
    side
        Of a window, pixels of the strip.
    x, y
        Top-left pixels of the windows, of shapes that broadcast.

    Returns
    -------
    float32 `(m, …)`, `…` the shape of `x` and `y` together.
    """
    sums = []
    for table in tables:
        values = cv2.LUT(strip, np.ascontiguousarray(table[:, np.newaxis]))
        integral = np.asarray(cv2.integral(cv2.transform(values, _ADD)))
        inner = integral[y + side, x + side] - integral[y, x + side]
        sums.append(inner - integral[y + side, x] + integral[y, x])
    return np.asarray(sums, np.float32)


_ADD = np.ones((1, 3), np.float32)

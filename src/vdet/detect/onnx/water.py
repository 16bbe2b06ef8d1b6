"""Water on the windscreen: drops are recognized, and removed for a second search."""

import cv2
import numpy as np

from vdet.boxes import Image

WIDTH = 320
"""Width of the planes in which drops are recognized, pixels."""
_DIFFERENCE = 12
"""Minimum difference of a drop from its surroundings, grey levels."""
_AREAS, _MAX_SIDE = (3, 30), 9
"""Minimum and maximum area of a drop, and the maximum side of its bounding box, pixels."""
_FILLED = 0.35
"""Minimum fraction of its bounding box that a drop fills."""
_SHARPNESS = 0.2
"""Minimum fine contrast per gradient: the road behind wet glass is blurred."""
_IN_DROPS = 0.07
"""Minimum of that ratio times the fraction of the fine contrast that is in drops."""
_TILES, _COVERED = (16, 9), 0.7
"""Columns and rows of tiles, and the minimum fraction of them with drops."""
_MEDIAN = 0.011
"""Side of the median filter, as a fraction of the width."""


def without_drops(image: Image) -> Image | None:
    """Return an image as it would look without the drops on the glass; None if there are none.

    `image` is BGR uint8, `(height, width, 3)`; so is the result, in which details are blurred.
    """
    height, width = image.shape[:2]
    size = WIDTH, max(1, round(height * WIDTH / width))
    green = cv2.resize(cv2.extractChannel(image, 1), size, interpolation=cv2.INTER_AREA)
    if not is_wet(np.asarray(green, np.uint8)):
        return None
    return np.asarray(cv2.medianBlur(image, round(_MEDIAN * width) | 1), np.uint8)


def is_wet(plane: Image) -> bool:
    """Return whether there is water on the glass: sharp drops everywhere, and little else is sharp.

    `plane` is grey uint8, `WIDTH` pixels wide. The limits were chosen on 40 data sets of roads and
    one clip of a wet windscreen.
    """
    smooth = cv2.medianBlur(plane, 5)
    fine = cv2.absdiff(plane, smooth)
    x, y = cv2.spatialGradient(smooth)
    gradient = cv2.magnitude(x.astype(np.float32), y.astype(np.float32)).mean()
    sharpness = fine.mean() / (gradient + 1)
    if sharpness < _SHARPNESS:
        return False
    spots = cv2.threshold(fine, _DIFFERENCE, 255, cv2.THRESH_BINARY)[1]
    if (cv2.resize(spots, _TILES, interpolation=cv2.INTER_AREA) > 0).mean() <= _COVERED:
        return False  # the same condition as below, for all spots: it is quick
    _, _, stats, centers = cv2.connectedComponentsWithStats(spots)
    widths, heights, areas = stats[1:, 2], stats[1:, 3], stats[1:, 4]
    is_drop = (areas >= _AREAS[0]) & (areas <= _AREAS[1]) & (areas >= _FILLED * widths * heights)
    is_drop &= np.maximum(widths, heights) <= _MAX_SIDE
    in_drops = areas[is_drop].sum() / max(1, areas.sum())
    columns, rows = (centers[1:][is_drop] / plane.shape[::-1] * _TILES).astype(int).T
    covered = len(np.unique(rows * _TILES[0] + columns)) / (_TILES[0] * _TILES[1])
    return bool(in_drops * sharpness > _IN_DROPS and covered > _COVERED)

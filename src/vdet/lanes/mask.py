"""The pixels, seen from above, that are paint.

From above a line has one width at all distances. A pixel is paint where it is lighter or yellower
than the road at a little distance on *both* sides: the edge of a shadow, of a kerb or of pale
concrete is lighter than one side only. Lightness is compared as a share of the road's own, which
a shadow leaves as it is; yellow paint is told from pale concrete by its colour.
"""

import cv2
import numpy as np

from vdet.config.lanes import MaskSettings
from vdet.media.images import Image


def lane_mask(above: Image, settings: MaskSettings, across: float) -> Image:
    """Return 255 where paint is, else 0, uint8 `(rows, columns)`.

    Parameters
    ----------
    above
        The road from above, BGR uint8 `(rows, columns, 3)`.
    across
        Pixels a metre across the road.
    """
    width = round(settings.line_width * across) | 1  # odd, so that nothing moves sideways
    reach = max(1, round(settings.reach * across))
    smooth = cv2.blur(cv2.cvtColor(above, cv2.COLOR_BGR2Lab), (width, 3))
    lightness, yellow = (np.asarray(cv2.extractChannel(smooth, i), np.uint8) for i in (0, 2))
    road = _lighter_side(lightness, reach)
    rise = cv2.subtract(lightness, road)  # 0 where it would be negative
    least = np.maximum(road * np.float32(settings.lightness), settings.least_lightness)
    tint = cv2.subtract(yellow, _lighter_side(yellow, reach))
    paint = (rise > least) | (tint > settings.yellow)
    return np.where(paint, np.uint8(255), np.uint8(0))


def _lighter_side(channel: Image, reach: int) -> Image:
    """Return the larger of the values `reach` columns to the left and to the right."""
    padded = cv2.copyMakeBorder(channel, 0, 0, reach, reach, cv2.BORDER_CONSTANT, value=(255,))
    columns = channel.shape[1]
    return np.maximum(padded[:, :columns], padded[:, 2 * reach :])

"""Detections of the last frames summed into a heatmap, and the regions where it is hot.

Source: seed section 3, "Combine frames to create a heatmap and find contours".
"""

from collections import deque
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from vdet.config.schema import HeatSettings
from vdet.geometry import Box
from vdet.windows import Windows

Heat = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Region:
    """A connected part of the heatmap above the threshold.

    `box` is its bounding rectangle, `centroid` its centre of mass as `(x, y)` (both in full-frame
    pixels), `peak` the highest heat in it.
    """

    box: Box
    centroid: tuple[float, float]
    peak: float


class HeatMap:
    """Sums the probabilities of detected windows over the last frames.

    Parameters
    ----------
    width, height
        Size of the frames, pixels.
    settings
        Lengths already scaled to that size.
    """

    def __init__(self, width: int, height: int, settings: HeatSettings) -> None:
        self._shape = (height, width)
        self._settings = settings
        self._recent: deque[Heat] = deque(maxlen=settings.frames)

    def update(self, detections: Windows) -> Heat:
        """Add a frame's detected windows, forget the oldest frame, return the blurred sum.

        Returns
        -------
        float32 of shape `(height, width)`: the sum over the last `frames` frames, this one
        included, of the probabilities of the windows that cover each pixel, then blurred.
        """
        self._recent.append(self._heat_of(detections))
        total = np.zeros(self._shape, np.float32)
        for heat in self._recent:
            total += heat
        side = self._settings.blur | 1  # a Gaussian kernel has a middle
        if side > 1:
            cv2.GaussianBlur(total, (side, side), 0, dst=total)
        return total

    def _heat_of(self, detections: Windows) -> Heat:
        heat = np.zeros(self._shape, np.float32)
        for (x, y, width, height), probability in zip(
            detections.boxes.tolist(), detections.probabilities.tolist(), strict=True
        ):
            rows = slice(max(0, y), max(0, y + height))
            heat[rows, max(0, x) : max(0, x + width)] += probability
        return heat


def find_regions(heat: Heat, threshold: float) -> list[Region]:
    """Return the connected regions where `heat` is above `threshold`, topmost-leftmost first.

    Outer contours only: a hole does not split a region. The centroid is that of the filled
    outline (`cv2.moments`), or the middle of the box where the outline is a line or a point.
    """
    hot = (heat > threshold).astype(np.uint8)
    contours, _ = cv2.findContours(hot, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    regions = [_region(heat, hot, contour) for contour in contours]
    return sorted(regions, key=lambda region: (region.box.y, region.box.x))


def _region(heat: Heat, hot: npt.NDArray[np.uint8], contour: cv2.typing.MatLike) -> Region:
    x, y, width, height = cv2.boundingRect(contour)
    box = Box(x, y, width, height)
    inside = np.zeros((height, width), np.uint8)
    cv2.drawContours(inside, [contour], -1, 1, cv2.FILLED, offset=(-x, -y))
    inside &= hot[y : box.bottom, x : box.right]
    peak = float(heat[y : box.bottom, x : box.right][inside > 0].max())
    moments = cv2.moments(contour)
    area = moments["m00"]
    centroid = (moments["m10"] / area, moments["m01"] / area) if area else box.center
    return Region(box, centroid, peak)

"""Detections of the last frames summed into a heatmap, and the regions where it is hot.

A window heats the vehicle that it shows: with box regression that is tighter than the window.

Source: seed section 3, "Combine frames to create a heatmap and find contours".
"""

from collections import deque
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from vdet.config.schema import HeatSettings
from vdet.detect.svm.windows import Windows
from vdet.geometry import Box

Values = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Heat:
    """A heatmap: float32 `values`, each of them for `shrink` × `shrink` pixels of the frame."""

    values: Values
    shrink: int = 1

    @property
    def peak(self) -> float:
        """The highest value."""
        return float(self.values.max(initial=0))


@dataclass(frozen=True, slots=True)
class Region:
    """A connected part of the heatmap above the threshold.

    `box` is its bounding rectangle, `centroid` its centre of mass as `(x, y)` (both in full-frame
    pixels), `peak` the highest heat in it, or the weight of the votes for it (`votes`).
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
        self._shape = (-(-height // settings.shrink), -(-width // settings.shrink))
        self._settings = settings
        self._recent: deque[Values] = deque(maxlen=settings.frames)

    def update(self, detections: Windows) -> Heat:
        """Add a frame's detected windows, forget the oldest frame, return the blurred sum.

        The sum runs over the last `frames` frames, this one included, and the windows that cover a
        pixel; each adds its probability, or with `weight: coverage` its share of that.
        """
        self._recent.append(self._values_of(detections))
        total = np.zeros(self._shape, np.float32)
        for values in self._recent:
            total += values
        side = self._settings.blur // self._settings.shrink | 1  # a Gaussian kernel has a middle
        if side > 1:
            cv2.GaussianBlur(total, (side, side), 0, dst=total)
        return Heat(total, self._settings.shrink)

    def _values_of(self, detections: Windows) -> Values:
        values = np.zeros(self._shape, np.float32)
        heats = detections.probabilities
        if self._settings.weight == "coverage":
            heats = heats * detections.shares
        sides = detections.vehicles.astype(np.float64)
        sides[:, 2:] += sides[:, :2]
        sides = np.maximum(0, np.floor(sides / self._settings.shrink + 0.5)).astype(np.int64)
        for (left, top, right, bottom), heat in zip(sides.tolist(), heats.tolist(), strict=True):
            values[top:bottom, left:right] += heat
        return values


def find_regions(heat: Heat, threshold: float) -> list[Region]:
    """Return the connected regions where `heat` is above `threshold`, topmost-leftmost first.

    Outer contours only: a hole does not split a region. The centroid is that of the filled
    outline (`cv2.moments`), or the middle of the box where the outline is a line or a point.
    """
    hot = (heat.values > threshold).astype(np.uint8)
    contours, _ = cv2.findContours(hot, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    regions = [_region(heat, hot, contour) for contour in contours]
    return sorted(regions, key=lambda region: (region.box.y, region.box.x))


def _region(heat: Heat, hot: npt.NDArray[np.uint8], contour: cv2.typing.MatLike) -> Region:
    x, y, width, height = cv2.boundingRect(contour)
    inside = np.zeros((height, width), np.uint8)
    cv2.drawContours(inside, [contour], -1, 1, cv2.FILLED, offset=(-x, -y))
    inside &= hot[y : y + height, x : x + width]
    peak = float(heat.values[y : y + height, x : x + width][inside > 0].max())
    n = heat.shrink
    box = Box(n * x, n * y, n * width, n * height)
    moments = cv2.moments(contour)
    area = moments["m00"]
    if not area:
        return Region(box, box.center, peak)
    offset = (n - 1) / 2  # the middle of a value's pixels
    centroid = (n * moments["m10"] / area + offset, n * moments["m01"] / area + offset)
    return Region(box, centroid, peak)

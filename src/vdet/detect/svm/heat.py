"""The heatmap, the sum of the hits of the last frames, and the regions where it is hot.

A hit adds to the pixels of its vehicle (`Windows.vehicles`), which with box regression is smaller
than the window. The original system summed heat in the same way.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Box, Float32Array, from_xywh
from vdet.config.detector import HeatSettings
from vdet.config.section import REFERENCE_HEIGHT
from vdet.detect.svm.windows import Windows


@dataclass(frozen=True, slots=True)
class Heat:
    """A heatmap: float32 `values`, each for `shrink` × `shrink` pixels of the frame."""

    values: Float32Array
    shrink: int = 1

    @property
    def peak(self) -> float:
        """The highest value."""
        return float(self.values.max(initial=0))


@dataclass(frozen=True, slots=True)
class HotRegion:
    """A part of a frame with evidence for a vehicle.

    Attributes
    ----------
    box
        Its bounding rectangle, pixels of the frame.
    centroid
        Its centre of mass `(x, y)`, pixels of the frame.
    strength
        The highest heat in it; for a region found by votes, their weight.
    """

    box: Box
    centroid: tuple[float, float]
    strength: float


_BLUR = 15
"""Side of the Gaussian kernel that blurs the heat, in pixels of `REFERENCE_HEIGHT` rows."""
_SHRINK = 4
"""Width and height in pixels of a heat value, with votes; 1 with outlines."""


def sum_heat(recent: Sequence[Windows], size: tuple[int, int], settings: HeatSettings) -> Heat:
    """Return the blurred sum of the hits of the last frames.

    Each hit adds to the values that its vehicle covers: its probability or, with `votes`,
    its probability times its weight.

    Parameters
    ----------
    recent
        The hits of each frame.
    size
        Width and height of the frames, pixels.
    """
    by_votes = settings.votes is not None
    shrink = _SHRINK if by_votes else 1
    total = np.zeros([-(-side // shrink) for side in reversed(size)], np.float32)
    for hits in recent:
        values = np.zeros_like(total)
        heats = hits.probabilities * hits.weights if by_votes else hits.probabilities
        sides = np.maximum(0, np.floor(from_xywh(hits.vehicles) / shrink + 0.5)).astype(np.int64)
        for (left, top, right, bottom), heat in zip(sides.tolist(), heats.tolist(), strict=True):
            values[top:bottom, left:right] += heat
        total += values
    side = int(_BLUR * size[1] / REFERENCE_HEIGHT + 0.5) // shrink | 1  # a kernel has a middle
    if side > 1:
        cv2.GaussianBlur(total, (side, side), 0, dst=total)
    return Heat(total, shrink)


def find_regions(heat: Heat, threshold: float) -> list[HotRegion]:
    """Return the connected regions where `heat` is above `threshold`, from top to bottom.

    A region with a hole is one region: only outer contours count. The centroid is that of the
    filled contour (`cv2.moments`), or the centre of the box if the contour is a line or a point.
    """
    hot = (heat.values > threshold).astype(np.uint8)
    contours, _ = cv2.findContours(hot, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    regions = [_region(heat, hot, contour) for contour in contours]
    return sorted(regions, key=lambda region: (region.box.y1, region.box.x1))


def _region(heat: Heat, hot: npt.NDArray[np.uint8], contour: cv2.typing.MatLike) -> HotRegion:
    x, y, width, height = cv2.boundingRect(contour)
    inside, part = np.zeros((height, width), np.uint8), np.s_[y : y + height, x : x + width]
    cv2.drawContours(inside, [contour], -1, 1, cv2.FILLED, offset=(-x, -y))
    peak = float(heat.values[part][(inside & hot[part]) > 0].max())
    n, moments = heat.shrink, cv2.moments(contour)
    box = Box.sized(n * x, n * y, n * width, n * height)
    if not (area := moments["m00"]):
        return HotRegion(box, box.center, peak)
    offset = (n - 1) / 2  # from the first pixel of a value to their middle
    centroid = (n * moments["m10"] / area + offset, n * moments["m01"] / area + offset)
    return HotRegion(box, centroid, peak)

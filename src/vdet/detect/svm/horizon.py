"""The horizon of a camera over a road: the row where the lines of the road meet.

Lane lines, barriers, kerbs and roofs run along the road, so in the image they meet in its vanishing
point. Line segments vote for it (von Gioi et al., "LSD: a Line Segment Detector", 2012).
"""

from collections.abc import Sequence

import cv2
import numpy as np

from vdet.boxes import Float64Array, Image

DEFAULT_HORIZON = 0.58
"""Usual horizon of dashboard cameras, fraction of the height; used if none is found."""

_WIDTH = 640  # pixels of the image in which segments are detected
_MIN_LENGTH = 0.02  # of a segment, fraction of the width
_SLOPES = (12.0, 75.0)  # degrees from the horizontal; vehicles are flatter, poles are steeper
_MAX_SINE = 0.05  # of the angle between a segment and the direction to its vanishing point
_MIN_SEGMENTS = 8  # on each side
_ROWS = np.arange(0.30, 0.75, 0.01)
_COLUMNS = np.arange(0.25, 0.76, 0.02)


def find_horizon(images: Sequence[Image]) -> float | None:
    """Return the row of the horizon, fraction of the frame's height.

    Parameters
    ----------
    images
        Frames of one camera, BGR uint8 `(H, W, 3)`, all of one size.

    Returns
    -------
    0.30 to 0.74 in steps of 0.01; None if too few lines run along the road.
    """
    height, width = images[0].shape[:2]
    ends = np.concatenate([_segment_ends(image) for image in images])
    directions = ends[:, 2:] - ends[:, :2]
    falling = directions[:, 0] * directions[:, 1] > 0
    sides = ends[falling], ends[~falling]
    if min(map(len, sides)) < _MIN_SEGMENTS:
        return None
    left, right = (_sum_votes(side, height / width) for side in sides)
    both = np.minimum(left, right)  # a vanishing point has lines on both sides
    votes = both + 0.2 * (left + right)
    row, _ = np.unravel_index(int(votes.argmax()), votes.shape)
    return round(float(_ROWS[row]), 2) if both.any() else None


def _segment_ends(image: Image) -> Float64Array:
    """Return x, y of both ends of the usable segments, `(n, 4)`, in widths of the frame."""
    height, width = image.shape[:2]
    small = (_WIDTH, max(1, round(height * _WIDTH / width)))
    grey = cv2.cvtColor(cv2.resize(image, small, interpolation=cv2.INTER_AREA), cv2.COLOR_BGR2GRAY)
    lines = cv2.createLineSegmentDetector().detect(grey)[0]
    ends = np.zeros((0, 4)) if lines is None else np.asarray(lines, np.float64).reshape(-1, 4)
    ends = ends / _WIDTH
    across, down = abs(ends[:, 2] - ends[:, 0]), abs(ends[:, 3] - ends[:, 1])
    slopes = np.degrees(np.arctan2(down, across))
    usable = (np.hypot(across, down) > _MIN_LENGTH) & (slopes > _SLOPES[0]) & (slopes < _SLOPES[1])
    return np.asarray(ends[usable])


def _sum_votes(ends: Float64Array, aspect: float) -> Float64Array:
    """Sum the votes of segments, `(n, 4)`, for each point, `(rows, columns)`.

    A segment votes for points above its centre, weighted by its length.
    """
    directions = ends[:, 2:] - ends[:, :2]
    lengths = np.hypot(directions[:, 0], directions[:, 1])
    normals = np.stack([-directions[:, 1], directions[:, 0]], axis=1) / lengths[:, np.newaxis]
    middles = (ends[:, :2] + ends[:, 2:]) / 2
    x, y = np.meshgrid(_COLUMNS, _ROWS * aspect)
    dx, dy = x[..., np.newaxis] - middles[:, 0], y[..., np.newaxis] - middles[:, 1]
    sines = abs(dx * normals[:, 0] + dy * normals[:, 1]) / (np.hypot(dx, dy) + 1e-9)
    votes = lengths * np.maximum(0, 1 - (sines / _MAX_SINE) ** 2) * (dy < 0)
    return np.asarray(votes.sum(axis=-1))

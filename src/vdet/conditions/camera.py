"""Whether the camera moves, from small luma planes of a video.

Corners (Shi and Tomasi 1994) of a reference plane are tracked into later ones (Lucas and Kanade
1981), and a similarity is fitted to them by RANSAC (Fischler and Bolles 1981), which rejects
vehicles.
"""

from collections.abc import Iterable

import cv2
import numpy as np

from vdet.boxes import Box, Float32Array, Float64Array, Image
from vdet.errors import clock_text
from vdet.findings import Finding
from vdet.traffic.clock import joined, when

_LIMIT = 0.01
"""Displacement of a camera that is not reported, as a fraction of the frame's width."""
_POINTS, _MIN_POINTS = 80, 12
"""Number of corners to follow, and the minimum to lay a plane over another."""
_AGREEING = 0.5
"""Fraction of the corners that must agree with a similarity."""
_IN_PLACE = 0.75
"""Minimum correlation of the edges of two planes of one view, where no similarity is found: it is
0.8 to 1 before fixed cameras, also under clouds and by night, and 0.3 to 0.8 while driving.
"""
_ERROR = 0.3
"""Displacement within the error of measurement, pixels of a plane."""
_RENEWED = 30.0
"""Seconds after which corners are chosen again, because the light changes."""
_LOST = 3.0
"""Seconds after which a lost view is another view: a lorry does not hide everything for so long."""
_STILL = 0.9
"""Minimum fraction of planes in which a fixed camera has not moved since the previous one."""


class CameraWatch:
    """Tracks the displacement of the camera through the planes of one video."""

    def __init__(self) -> None:
        self._even = cv2.createCLAHE(4, (10, 6))
        """Equalizes contrast, against changes of light and fog (Zuiderveld 1994)."""
        self._times: list[float] = []
        self._positions: list[Float64Array] = []
        """Displacements of the corners of the frame since the start, `(4, 2)` each, fractions of
        the width: infinite in another view, NaN if unknown.
        """
        self._still_planes = self._lost_planes = 0
        self._plane: Image | None = None
        self._points = np.empty((0, 1, 2), np.float32)
        self._reference = np.zeros((4, 2))
        self._since = 0.0

    def add(self, time: float, plane: Image, boxes: Iterable[Box], *, is_clear: bool) -> bool:
        """Add the next plane, uint8 `(h, w)`; return whether the camera has not moved.

        `boxes` are those of vehicles, in pixels of the plane. `is_clear` says whether visibility is
        good: otherwise a view that is not found may be the same.
        """
        plane = np.asarray(self._even.apply(plane), np.uint8)
        moved = self._moved(plane, np.inf if is_clear else np.nan)
        position = self._reference + moved / plane.shape[1]
        before = self._positions[-1] if self._positions else position
        with np.errstate(invalid="ignore"):  # both may be other views
            is_steady = bool(np.abs(position - before).max() <= _LIMIT / 2)
        self._still_planes += is_steady
        self._lost_planes += bool(np.isinf(position).any())
        self._times.append(time)
        self._positions.append(position)
        is_old = time - self._since > _RENEWED and np.isfinite(position).all()
        if is_old or len(self._points) < _MIN_POINTS:
            if np.abs(moved).max() > _ERROR:  # so that small errors do not add up
                self._reference = position
            self._plane, self._since, self._points = plane, time, _corners(plane, boxes)
        return is_steady

    @property
    def is_still(self) -> bool:
        """Whether the camera was fixed most of the time."""
        return len(self._times) > 1 and not self.is_moving

    @property
    def is_moving(self) -> bool:
        """Whether it moved in more than a tenth of the planes so far."""
        return self._still_planes < _STILL * len(self._times)

    @property
    def travels(self) -> bool:
        """Whether it showed other views in more than a tenth of the planes so far."""
        return self._lost_planes > (1 - _STILL) * len(self._times)

    def findings(self) -> list[Finding]:
        """Return when the camera moved, or when it was moved permanently."""
        times, positions = np.array(self._times), np.array(self._positions)
        is_known = np.isfinite(positions).all(axis=(1, 2))
        off = _distances(positions, positions[is_known][:5])
        spans = [
            (first, last)
            for first, last in joined(times[off > _LIMIT].tolist())
            if last - first >= _LOST or (is_known & (times >= first) & (times <= last)).sum() > 1
        ]
        if not spans:
            return []
        size = float(off[is_known].max())
        extent = f"by up to {size:.1%} of the width" if size > _LIMIT else "to another view"
        start, end = spans[-1]
        after = positions[is_known & (times > start + 1)]
        rests = len(after) > 3 and np.quantile(_distances(after, after), 0.95) <= _LIMIT
        if rests and end == times[-1]:
            text = (
                f"the camera moved at {clock_text(int(start))}, {extent}: lines, zones and regions "
                "match only one part; process the two parts separately"
            )
            return [Finding("camera-moved", text, ((start, end),), "fact", size)]
        text = (
            f"the camera moves {when(spans)}, {extent}: lines, zones and regions no longer match; "
            "do not trust counts and speeds"
        )
        return [Finding("camera-moves", text, tuple(spans), "fact", size)]

    def _moved(self, plane: Image, lost: float) -> Float64Array:
        """Return the displacement of the corners of the frame in a plane, `(4, 2)` pixels.

        It is `lost` if the view is not found.
        """
        if self._plane is None:
            return np.zeros((4, 2))
        if len(self._points) >= _MIN_POINTS:
            tracked, status, _ = cv2.calcOpticalFlowPyrLK(
                self._plane, plane, self._points, np.empty(0), winSize=(9, 9), maxLevel=2
            )
            seen = status.ravel() > 0
            if seen.sum() >= _MIN_POINTS:
                matrix, agreeing = cv2.estimateAffinePartial2D(
                    self._points[seen], tracked[seen], ransacReprojThreshold=0.7, maxIters=200
                )
                if agreeing.sum() >= _AGREEING * len(seen):
                    height, width = plane.shape
                    corners = np.array([(0, 0), (width, 0), (0, height), (width, height)])
                    return np.asarray(corners @ matrix[:, :2].T + matrix[:, 2] - corners)
        else:
            lost = np.nan
        with np.errstate(invalid="ignore"):  # a plane without edges
            agreement = np.corrcoef(_edges(self._plane).ravel(), _edges(plane).ravel())[0, 1]
        return np.full((4, 2), 0.0 if agreement >= _IN_PLACE else lost)


def _distances(positions: Float64Array, usual: Float64Array) -> Float64Array:
    """Return the mean distance of the corners from the median of the usual positions, `(n,)`."""
    x, y = np.moveaxis(positions - np.median(usual, axis=0), -1, 0)
    return np.asarray(np.hypot(x, y).mean(axis=1))


def _edges(plane: Image) -> Float32Array:
    """Return the edges of a plane, limited, so that many weak ones count like a few strong ones."""
    soft = cv2.GaussianBlur(plane.astype(np.float32), (0, 0), 1)
    return np.asarray(np.clip(soft - cv2.GaussianBlur(soft, (0, 0), 3), -12, 12), np.float32)


def _corners(plane: Image, boxes: Iterable[Box]) -> Float32Array:
    """Return corners outside the boxes, `(n, 1, 2)`."""
    mask = np.full(plane.shape, 255, np.uint8)
    for box in boxes:
        box.cut(mask)[:] = 0
    corners = cv2.goodFeaturesToTrack(plane, _POINTS, 0.02, 5, mask=mask)
    return np.empty((0, 1, 2), np.float32) if corners is None else np.asarray(corners, np.float32)

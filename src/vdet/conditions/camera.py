"""Whether the camera moves: how the small planes of a video lie over one of them.

Corners (Shi and Tomasi 1994) of a plane are followed into later ones (Lucas and Kanade 1981), and
a similarity is fitted to them by RANSAC (Fischler and Bolles 1981): what drives does not count.
"""

from collections.abc import Iterable

import cv2
import numpy as np

from vdet.boxes import BoolArray, Box, Float32Array, Float64Array, Image
from vdet.conditions.finding import Finding, Span, joined, when

_LIMIT = 0.01
"""Displacement of a camera that is not worth a word, as a fraction of the frame's width."""
_POINTS = 80
_FEWEST = 12
"""Number of corners from which a plane can be laid over another."""
_AGREEING = 0.5
"""Fraction of the corners that must agree with a similarity."""
_ERROR = 0.3
"""Displacement that is only an error of measurement, pixels of a plane."""
_RENEWED, _GIVEN_UP = 30.0, 5.0
"""Seconds after which corners are chosen anew: while they are found, and while they are not."""
_GAP = 2.0
"""Seconds of rest that end a movement."""
_AROUND = 15
"""Side of the part of a plane in which the contrast is made even, pixels."""
_NOISE = 2.0
"""Contrast that is only noise, grey levels."""
_LOST = 3.0
"""Seconds after which a view that is not found again is another view."""
_STILL = 0.9
"""Fraction of the planes in which a still camera stands where it stood."""


class CameraWatch:
    """Follows the place of the camera through the planes of one video.

    `places` are how far the corners of the frame are from where they were in the first plane,
    `(4, 2)` each, as fractions of the width; NaN where that is not known.
    """

    def __init__(self) -> None:
        self.times: list[float] = []
        self.places: list[Float64Array] = []
        self._plane: Image | None = None
        self._points = np.empty((0, 1, 2), np.float32)
        self._place = np.zeros((4, 2))
        self._since = self._found = 0.0
        self._stood: list[bool] = []
        self._lost: list[bool] = []

    def add(self, time: float, plane: Image, boxes: Iterable[Box]) -> bool:
        """Add the next plane, uint8 `(h, w)`; return whether the camera stands as before.

        `boxes` are those of vehicles, in pixels of the plane.
        """
        plane = _evened(plane)
        moved = self._moved(plane)
        before = self.places[-1] if self.places else self._place
        self.times.append(time)
        self.places.append(self._place + moved / plane.shape[1])
        is_found = bool(np.isfinite(moved).all())
        self._lost.append(not is_found and len(self._points) >= _FEWEST)
        self._found = time if is_found else self._found
        late = time - self._since > _RENEWED if is_found else time - self._found > _GIVEN_UP
        if self._plane is None or late:
            if is_found and np.abs(moved).max() > _ERROR:  # small errors do not add up
                self._place = self.places[-1]
            self._plane, self._since, self._found = plane, time, time
            self._points = _corners(plane, boxes)
        self._stood.append(bool(np.abs(self.places[-1] - before).max() <= _LIMIT / 2))
        return self._stood[-1]

    @property
    def is_still(self) -> bool:
        """Whether it has stood still most of the time."""
        return len(self._stood) > 1 and float(np.mean(self._stood)) >= _STILL

    def findings(self, is_clear: BoolArray) -> list[Finding]:
        """Return from when to when it moved, or when it was moved for good.

        `is_clear` says in which planes one sees well, `(n,)`: in others a view may not be found.
        """
        if not self.times:
            return []
        places, times = np.array(self.places), np.array(self.times)
        base = np.nanmedian(places[:5], axis=0)  # the first is known
        off = np.hypot(*np.moveaxis(places - base, -1, 0)).mean(axis=1)
        away = np.array(self._lost) & is_clear | (off > _LIMIT)
        spans = [span for span in joined(times[away].tolist(), _GAP) if _is_real(off, times, span)]
        if not spans:
            return []
        first, last = spans[-1]
        tail = places[(times > first + 1) & np.isfinite(off)]
        if last == times[-1] and len(tail) > 3 and _spread(tail) <= _LIMIT:
            size = float(np.nanmax(off[times >= first]))
            text = (
                f"the camera was moved at {when([(first, last)]).split()[1]}, by {size:.1%} of the "
                "width: lines and regions fit only before or only after; process both parts apart"
            )
            return [Finding("camera-moved", text, ((first, last),), value=size)]
        seen = off[away & np.isfinite(off)]
        size = float(seen.max()) if len(seen) else None
        much = f", by up to {size:.1%} of the width" if size else ", so far that nothing matches"
        text = (
            f"the camera moves {when(spans)}{much}: lines, zones, regions and the ground do not "
            "stay where they were drawn; do not trust counts and speeds in these times"
        )
        return [Finding("camera-moves", text, tuple(spans), value=size)]

    def _moved(self, plane: Image) -> Float64Array:
        """Return how far its corners are from those of the plane with the points, pixels."""
        unknown = np.full((4, 2), np.nan)
        if self._plane is None:
            return np.zeros((4, 2))
        if len(self._points) < _FEWEST:
            return unknown
        found, status, _ = cv2.calcOpticalFlowPyrLK(
            self._plane, plane, self._points, np.empty(0), winSize=(9, 9), maxLevel=2
        )
        seen = status.ravel() > 0
        if seen.sum() < _FEWEST:
            return unknown
        matrix, agreeing = cv2.estimateAffinePartial2D(
            self._points[seen], found[seen], ransacReprojThreshold=0.7, maxIters=200
        )
        if matrix is None or agreeing.sum() < _AGREEING * len(self._points):
            return unknown
        height, width = plane.shape
        corners = np.array([(0, 0), (width, 0), (0, height), (width, height)], np.float64)
        return np.asarray(corners @ matrix[:, :2].T + matrix[:, 2] - corners)


def _evened(plane: Image) -> Image:
    """Return a plane whose local contrast does not depend on light and fog."""
    values = plane.astype(np.float32)
    mean = cv2.blur(values, (_AROUND, _AROUND))
    squares = cv2.blur(values * values, (_AROUND, _AROUND)) - mean * mean
    even = (values - mean) / (np.sqrt(np.maximum(squares, 0)) + _NOISE)
    return np.asarray(np.clip(even * 40 + 128, 0, 255), np.uint8)


def _corners(plane: Image, boxes: Iterable[Box]) -> Float32Array:
    """Return corners outside the boxes, float32 `(n, 1, 2)`."""
    mask = np.full(plane.shape, 255, np.uint8)
    for box in boxes:
        box.cut(mask)[:] = 0
    found = cv2.goodFeaturesToTrack(plane, _POINTS, 0.02, 5, mask=mask)
    return np.empty((0, 1, 2), np.float32) if found is None else np.asarray(found, np.float32)


def _is_real(off: Float64Array, times: Float64Array, span: Span) -> bool:
    """Return whether it moved: a lorry that hides all for a moment does not count."""
    inside = off[(times >= span[0]) & (times <= span[1])]
    return int(np.isfinite(inside).sum()) >= 2 or span[1] - span[0] >= _LOST


def _spread(places: Float64Array) -> float:
    middle = np.median(places, axis=0)
    return float(np.quantile(np.hypot(*np.moveaxis(places - middle, -1, 0)).mean(axis=1), 0.95))

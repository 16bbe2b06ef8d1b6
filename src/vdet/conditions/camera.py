"""Whether the camera moves: how the small planes of a video lie over one of them.

Corners (Shi and Tomasi 1994) of a plane are followed into later ones (Lucas and Kanade 1981), and
a similarity is fitted to them by RANSAC (Fischler and Bolles 1981): what drives does not count.
"""

from collections.abc import Iterable

import cv2
import numpy as np

from vdet.boxes import BoolArray, Box, Float32Array, Float64Array, Image
from vdet.conditions.finding import Finding, joined, when
from vdet.errors import clock

_LIMIT = 0.01
"""Displacement of a camera that is not worth a word, as a fraction of the frame's width."""
_POINTS, _FEWEST = 80, 12
"""Number of corners, and that from which a plane can be laid over another."""
_AGREEING = 0.5
"""Fraction of the corners that must agree with a similarity."""
_ERROR = 0.3
"""Displacement that is only an error of measurement, pixels of a plane."""
_RENEWED, _GIVEN_UP = 30.0, 5.0
"""Seconds after which corners are chosen anew: while they are found, and while they are not."""
_GAP = 2.0
"""Seconds of rest that end a movement."""
_LOST = 3.0
"""Seconds after which a view that is not found again is another view: no lorry hides it all."""
_STILL = 0.9
"""Fraction of the planes in which a still camera stands as in the plane before."""
_UNKNOWN = np.full((4, 2), np.nan)


class CameraWatch:
    """Follows the place of the camera through the planes of one video."""

    def __init__(self) -> None:
        self._even = cv2.createCLAHE(4, (10, 6))
        """Makes contrast even, so that light and fog do not matter (Zuiderveld 1994)."""
        self._times: list[float] = []
        self._places: list[Float64Array] = []
        """How far the corners of the frame are from where they were at first, `(4, 2)` each, as
        fractions of the width; NaN where that is not known.
        """
        self._lost: list[bool] = []
        self._stood: list[bool] = []
        self._plane: Image | None = None
        self._points = np.empty((0, 1, 2), np.float32)
        self._place = np.zeros((4, 2))
        self._since = self._found = 0.0

    def add(self, time: float, plane: Image, boxes: Iterable[Box]) -> bool:
        """Add the next plane, uint8 `(h, w)`; return whether the camera stands as before.

        `boxes` are those of vehicles, in pixels of the plane.
        """
        plane = np.asarray(self._even.apply(plane), np.uint8)
        moved = _moved(self._plane, plane, self._points) if self._times else np.zeros((4, 2))
        before = self._places[-1] if self._times else self._place
        is_found = bool(np.isfinite(moved).all())
        self._times.append(time)
        self._places.append(self._place + moved / plane.shape[1])
        self._lost.append(not is_found and len(self._points) >= _FEWEST)
        self._stood.append(bool(np.abs(self._places[-1] - before).max() <= _LIMIT / 2))
        self._found = time if is_found else self._found
        late = time - self._since > _RENEWED if is_found else time - self._found > _GIVEN_UP
        if self._plane is None or late:
            if is_found and np.abs(moved).max() > _ERROR:  # small errors do not add up
                self._place = self._places[-1]
            self._plane, self._since, self._found = plane, time, time
            self._points = _corners(plane, boxes)
        return self._stood[-1]

    @property
    def is_still(self) -> bool:
        """Whether it has stood still most of the time."""
        return len(self._stood) > 1 and float(np.mean(self._stood)) >= _STILL

    def findings(self, is_clear: BoolArray) -> list[Finding]:
        """Return from when to when it moved, or when it was moved for good.

        `is_clear` says in which planes one sees well, `(n,)`: in others a view may not be found.
        """
        if not self._times:
            return []
        times, places = np.array(self._times), np.array(self._places)
        off = _distances(places, np.nanmedian(places[:5], axis=0))  # the first is known
        away = np.array(self._lost) & is_clear | (off > _LIMIT)
        spans = []
        for first, last in joined(times[away].tolist(), _GAP):
            measured = np.isfinite(off[(times >= first) & (times <= last)]).sum()
            if measured > 1 or last - first >= _LOST:
                spans.append((first, last))
        if not spans:
            return []
        size = float(np.nanmax(off))
        much = f"by up to {size:.1%} of the width" if size > _LIMIT else "out of its view"
        start, end = spans[-1]
        after = places[(times > start + 1) & np.isfinite(off)]
        if end == times[-1] and len(after) > 3:
            spread = _distances(after, np.median(after, axis=0))
            if np.quantile(spread, 0.95) <= _LIMIT:
                text = (
                    f"the camera moved at {clock(int(start))}, {much}: lines, zones and regions "
                    "fit only before or after; process both parts separately"
                )
                return [Finding("camera-moved", text, ((start, end),), value=size)]
        text = (
            f"the camera moves {when(spans)}, {much}: lines, zones, regions and ground points do "
            "not fit the view; do not trust counts and speeds of these times"
        )
        return [Finding("camera-moves", text, tuple(spans), value=size)]


def _distances(places: Float64Array, base: Float64Array) -> Float64Array:
    """Return the mean distance of the corners from their places in `base`, `(n,)`."""
    return np.asarray(np.hypot(*np.moveaxis(places - base, -1, 0)).mean(axis=1))


def _moved(earlier: Image | None, plane: Image, points: Float32Array) -> Float64Array:
    """Return how far the corners of a frame are from those of an earlier plane, `(4, 2)` pixels."""
    if earlier is None or len(points) < _FEWEST:
        return _UNKNOWN
    found, status, _ = cv2.calcOpticalFlowPyrLK(
        earlier, plane, points, np.empty(0), winSize=(9, 9), maxLevel=2
    )
    seen = status.ravel() > 0
    if seen.sum() < _FEWEST:
        return _UNKNOWN
    matrix, agreeing = cv2.estimateAffinePartial2D(
        points[seen], found[seen], ransacReprojThreshold=0.7, maxIters=200
    )
    if matrix is None or agreeing.sum() < _AGREEING * len(points):
        return _UNKNOWN
    height, width = plane.shape
    corners = np.array([(0, 0), (width, 0), (0, height), (width, height)], np.float64)
    return np.asarray(corners @ matrix[:, :2].T + matrix[:, 2] - corners)


def _corners(plane: Image, boxes: Iterable[Box]) -> Float32Array:
    """Return corners outside the boxes, `(n, 1, 2)`."""
    mask = np.full(plane.shape, 255, np.uint8)
    for box in boxes:
        box.cut(mask)[:] = 0
    found = cv2.goodFeaturesToTrack(plane, _POINTS, 0.02, 5, mask=mask)
    return np.empty((0, 1, 2), np.float32) if found is None else np.asarray(found, np.float32)

"""Whether the camera moves, from small luma planes of a video.

Corners (Shi and Tomasi 1994) of a reference plane are tracked into later ones (Lucas and Kanade
1981), and a similarity is fitted to them by RANSAC (Fischler and Bolles 1981), which rejects
vehicles.
"""

import copy
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np

from vdet.boxes import Box, Float32Array, Float64Array, Image
from vdet.errors import clock_text
from vdet.findings import Finding
from vdet.traffic.clock import GAP, Span, when

_LIMIT = 0.01
"""Displacement of a camera that is not reported, as a fraction of the frame's width."""
_POINTS, _MIN_POINTS = 80, 12
"""Number of corners to follow, and the minimum to lay a plane over another."""
_AGREEING = 0.5
"""Fraction of the corners that must agree with a similarity."""
_IN_PLACE = 0.75
"""Minimum correlation of the edges of two planes of one view, where no similarity is found: it is
0.8 to 1 before fixed cameras, also under clouds, by night and in rain, and 0.4 to 0.8 while
driving.
"""
_MINIMUM_OF = 3
"""Maximum number of planes whose minimum is compared: it shows neither rain nor snow, which are
bright and never twice in one place.
"""
_ERROR = 0.3
"""Displacement within the error of measurement, pixels of a plane."""
_RENEWED = 30.0
"""Seconds after which corners are chosen again, because the light changes."""
_LOST = 3.0
"""Seconds after which a lost view is another view: a lorry does not hide everything for so long."""
_USUAL, _MAX_POSITIONS = 5, 400
"""Number of known positions that give the usual one, and of those kept to see whether it rests."""
_STILL = 0.9
"""Minimum fraction of planes in which a fixed camera has not moved since the previous one."""


class CameraWatch:
    """Tracks the displacement of the camera through the planes of one video."""

    def __init__(self) -> None:
        self._even = cv2.createCLAHE(4, (10, 6))
        """Equalizes contrast, against changes of light and fog (Zuiderveld 1994)."""
        self._displacement = _Displacement()
        self._position = np.zeros((4, 2))
        """Displacement of the corners of the frame since the start, fractions of the width:
        infinite in another view, NaN if unknown.
        """
        self._planes = self._still_planes = self._lost_planes = 0
        self._plane: Image | None = None
        self._latest, self._reference_planes = deque[Image](), list[Image]()
        """The latest planes, and those around the one in which the corners were chosen."""
        self._points = np.empty((0, 1, 2), np.float32)
        self._reference = np.zeros((4, 2))
        self._since = 0.0

    def add(self, time: float, plane: Image, boxes: Iterable[Box], *, is_clear: bool) -> bool:
        """Add the next plane, uint8 `(h, w)`; return whether the camera has not moved.

        `boxes` are those of vehicles, in pixels of the plane. `is_clear` says whether visibility is
        good: otherwise a view that is not found may be the same.
        """
        plane = np.asarray(self._even.apply(plane), np.uint8)
        self._latest.append(plane)
        if len(self._latest) > _MINIMUM_OF:
            planes = [*self._reference_planes, self._latest.popleft()]
            self._reference_planes = planes[:_MINIMUM_OF]
        moved = self._moved(plane, np.inf if is_clear else np.nan)
        position = self._reference + moved / plane.shape[1]
        with np.errstate(invalid="ignore"):  # both may be other views
            is_steady = bool(np.abs(position - self._position).max() <= _LIMIT / 2)
        self._planes += 1
        self._still_planes += is_steady
        self._lost_planes += bool(np.isinf(position).any())
        self._position = position
        self._displacement.add(time, position)
        is_old = time - self._since > _RENEWED and np.isfinite(position).all()
        if is_old or len(self._points) < _MIN_POINTS:
            if np.abs(moved).max() > _ERROR:  # so that small errors do not add up
                self._reference = position
            self._plane, self._since, self._points = plane, time, _corners(plane, boxes)
            self._reference_planes = list(self._latest)
            self._latest.clear()
        return is_steady

    def restart(self) -> None:
        """Take the next plane for the view from now on."""
        self._plane, self._points = None, np.empty((0, 1, 2), np.float32)
        self._latest.clear()
        self._reference = np.zeros((4, 2))

    @property
    def is_still(self) -> bool:
        """Whether the camera was fixed most of the time."""
        return self._planes > 1 and not self.is_moving

    @property
    def is_moving(self) -> bool:
        """Whether it moved in more than a tenth of the planes so far."""
        return self._still_planes < _STILL * self._planes

    @property
    def travels(self) -> bool:
        """Whether it showed other views in more than a tenth of the planes so far."""
        return self._lost_planes > (1 - _STILL) * self._planes

    def findings(self) -> list[Finding]:
        """Return when the camera moved, or when it was moved permanently."""
        displacement = copy.deepcopy(self._displacement)
        displacement.end()
        spans, size = displacement.spans, displacement.size
        if not spans:
            return []
        extent = f"by up to {size:.1%} of the width" if size > _LIMIT else "to another view"
        start, end = spans[-1]
        if displacement.rests:
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
            agreement = np.corrcoef(_edges(self._reference_planes), _edges(self._latest))[0, 1]
        return np.full((4, 2), 0.0 if agreement >= _IN_PLACE else lost)


@dataclass(slots=True)
class _Span:
    """A time span in which the camera is displaced, with the number of known positions before it.

    `known` is that up to `last`; `positions` are some of those from a second after `first`.
    """

    first: float
    last: float
    known_before: int
    known: int
    positions: list[Float64Array] = field(default_factory=list)
    step: int = 1
    skipped: int = 0

    @property
    def is_sure(self) -> bool:
        """Whether it is no single position, which may be wrong."""
        return self.last - self.first >= _LOST or self.known > self.known_before + 1

    def add(self, position: Float64Array) -> None:
        """Keep every position, or fewer if there are many."""
        self.skipped += 1
        if self.skipped >= self.step:
            self.skipped = 0
            self.positions.append(position)
        if len(self.positions) > _MAX_POSITIONS:
            self.positions, self.step = self.positions[::2], 2 * self.step


class _Displacement:
    """When the camera was displaced from its first known positions, in figures that do not grow.

    Attributes
    ----------
    spans
        When, seconds.
    size
        Maximum displacement, as a fraction of the frame's width.
    """

    def __init__(self) -> None:
        self.spans: list[Span] = []
        self.size = 0.0
        self._first: list[tuple[float, Float64Array]] = []  # until the usual position is known
        self._usual: Float64Array | None = None
        self._span: _Span | None = None
        self._known, self._time = 0, 0.0

    def add(self, time: float, position: Float64Array) -> None:
        """Add the next position, `(4, 2)`."""
        self._first.append((time, position))
        if self._usual is not None or sum(np.isfinite(p).all() for _, p in self._first) >= _USUAL:
            self._compare_first()

    def _compare_first(self) -> None:
        known = [position for _, position in self._first if np.isfinite(position).all()]
        if self._usual is None:
            self._usual = np.median(known, axis=0) if known else np.full((4, 2), np.nan)
        for time, position in self._first:
            self._compare(time, position, float(_distances(position, self._usual)))
        self._first = []

    def _compare(self, time: float, position: Float64Array, off: float) -> None:
        is_known, self._time = bool(np.isfinite(position).all()), time
        if is_known:
            self.size = max(self.size, off)
        if off > _LIMIT:
            if self._span and time - self._span.last > GAP:
                self._close()
            self._span = self._span or _Span(time, time, self._known, self._known)
            self._span.last, self._span.known = time, self._known + is_known
        self._known += is_known
        if self._span and is_known and time > self._span.first + 1:
            self._span.add(position)

    def _close(self) -> None:
        if self._span and self._span.is_sure:
            self.spans.append((self._span.first, self._span.last))
        self._span = None

    def end(self) -> None:
        """Complete the spans, after the last position."""
        self._compare_first()
        span = self._span
        self._close()
        after = np.array(span.positions if span else [])
        self.rests = bool(
            span
            and span.is_sure
            and span.last == self._time
            and len(after) > 3
            and np.quantile(_distances(after, np.median(after, axis=0)), 0.95) <= _LIMIT
        )


def _distances(positions: Float64Array, usual: Float64Array) -> Float64Array:
    """Return the mean distance of the corners from a usual position, `(...)`."""
    x, y = np.moveaxis(positions - usual, -1, 0)
    return np.asarray(np.hypot(x, y).mean(axis=-1))


def _edges(planes: Sequence[Image]) -> Float32Array:
    """Return the edges of the pixelwise minimum of planes `(h, w)`, as `(h * w,)`.

    They are limited, so that many weak ones count like a few strong ones.
    """
    soft = cv2.GaussianBlur(np.min(planes, axis=0).astype(np.float32), (0, 0), 1)
    edges = np.clip(soft - cv2.GaussianBlur(soft, (0, 0), 3), -12, 12)
    return np.asarray(edges.ravel(), np.float32)


def _corners(plane: Image, boxes: Iterable[Box]) -> Float32Array:
    """Return corners outside the boxes, `(n, 1, 2)`."""
    mask = np.full(plane.shape, 255, np.uint8)
    for box in boxes:
        box.cut(mask)[:] = 0
    corners = cv2.goodFeaturesToTrack(plane, _POINTS, 0.02, 5, mask=mask)
    return np.empty((0, 1, 2), np.float32) if corners is None else np.asarray(corners, np.float32)

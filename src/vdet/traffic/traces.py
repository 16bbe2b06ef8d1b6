"""Traces: what passes a line like a vehicle, and has no track.

The strip of a band is compared with its background: the median of some seconds without the tracked
vehicles. What differs, where vehicles drive, and is as large and lasts as long as the tracked
vehicles there, is a trace. Shadows, people and trembling are told apart by size and duration, light
that changes by the difference of the whole row. A trace is a hint: nothing is counted by it.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from functools import reduce

import cv2
import numpy as np

from vdet.boxes import BoolArray, Float32Array, Float64Array, Image, Int64Array
from vdet.track.track import FrameTracks
from vdet.traffic.strips import Band, Passage

_WINDOW = 20.0
"""Seconds of which the median is the background; there is one for each second."""
_SAMPLES = 24
"""Maximum number of frames of that median, and the minimum without a vehicle is a quarter."""
_PLAY = 2
"""Columns by which the background may move along the line."""
_MAX_GAIN = 8
"""Maximum change of the light of a frame, levels."""
_DIFFERENT = 10
"""Minimum difference from the background, levels."""
_MARGIN = 0.1
"""Margin of tracked boxes that are left out, as a fraction of their sides."""
_WIDTH, _SECONDS, _AREA = 0.45, 0.4, 0.15
"""Minimum width, duration and area of a trace, as fractions of those of tracked vehicles there."""
_LONGEST = 4
"""Maximum duration, as a multiple of the longest of tracked vehicles."""
_NEAR = 5
"""Number of the nearest tracked vehicles that a trace is compared with."""
_ENOUGH = 2
"""Minimum number of tracked vehicles that crossed."""
_SHORT = 0.2
"""Quantile of the durations of tracked vehicles that is short: others may have stood."""
_KNOWN = 100
"""Number of the latest ones that are compared."""
_DELAY = 4.0
"""Seconds after which a trace is complete."""


@dataclass(frozen=True, slots=True)
class Trace:
    """Something that passed a band like a vehicle, without a track.

    `time` is in seconds of the video, `place` a fraction of the length of the band, 0 to 1.
    """

    band: Band
    time: float
    place: float


@dataclass(frozen=True, slots=True)
class _Crossing:
    """How a tracked vehicle crossed: place and width, fractions of the band, and seconds.

    `passed` is when its foot passed, as a fraction of these seconds.
    """

    place: float
    width: float
    seconds: float
    passed: float


@dataclass(frozen=True, slots=True, eq=False)
class _Covers:
    """Which part of a band is covered by tracked boxes with their margin, a row for each box.

    `rows` are the frames, `starts` and `ends` fractions of the length of the band.
    """

    rows: Int64Array
    ids: Int64Array
    starts: Float64Array
    ends: Float64Array

    @classmethod
    def of(cls, band: Band, frames: Sequence[FrameTracks]) -> "_Covers":
        tracks = [(row, track) for row, frame in enumerate(frames) for track in frame.tracks]
        rows = np.array([row for row, _ in tracks], np.int64)
        ids = np.array([track.id for _, track in tracks], np.int64)
        corners = [(box.x1, box.y1, box.x2, box.y2) for box in (track.box for _, track in tracks)]
        boxes = np.array(corners, np.float64).reshape(-1, 2, 2)
        sides = _MARGIN * (boxes[:, 1] - boxes[:, 0])
        boxes += np.stack([-sides, sides], axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):  # the band may be level or upright
            along = (boxes - band.start) / np.subtract(band.end, band.start)
        starts = np.maximum(np.nanmax(along.min(axis=1), axis=1), 0)
        ends = np.minimum(np.nanmin(along.max(axis=1), axis=1), 1)
        covers = starts < ends
        return cls(rows[covers], ids[covers], starts[covers], ends[covers])

    def mask(self, frames: int, samples: int) -> BoolArray:
        """Return which samples are covered, `(frames, samples)`."""
        covered = np.zeros((frames, samples), np.bool_)
        firsts = (self.starts * samples).astype(int)
        lasts = np.ceil(self.ends * samples).astype(int)
        for row, first, last in zip(self.rows, firsts, lasts, strict=True):
            covered[row, first:last] = True
        return covered

    def crossings(self, passages: Sequence[Passage], times: Float64Array) -> list[_Crossing]:
        """Return how the tracks of passages cross the band."""
        crossings = []
        for passage in passages:
            boxes = np.flatnonzero(self.ids == passage.id)
            if len(boxes):
                first, last = times[self.rows[boxes[[0, -1]]]].tolist()
                width = float((self.ends - self.starts)[boxes].max()) / (1 + 2 * _MARGIN)
                seconds = (last - first + _step(times)) / (1 + 2 * _MARGIN)
                passed = (passage.time - first) / seconds - _MARGIN
                crossings.append(_Crossing(passage.place, width, seconds, passed))
        return crossings


class TraceSearch:
    """Looks for the traces at one band, minute by minute."""

    def __init__(self, band: Band) -> None:
        self._band = band
        self._frames: list[FrameTracks] = []
        self._rows: list[Image] = []
        self._crossings: deque[_Crossing] = deque(maxlen=_KNOWN)
        self._searched = -np.inf

    def search(
        self,
        frames: Sequence[FrameTracks],
        strips: Sequence[Image],
        passages: Sequence[Passage],
        *,
        is_end: bool,
    ) -> list[Trace]:
        """Return the traces that are complete with the next frames.

        Parameters
        ----------
        frames
            The tracks of all classes.
        strips
            The band of each, uint8 `(rows, samples, 3)`.
        passages
            Those of tracks at the band.
        is_end
            Whether the video ends.
        """
        self._frames += frames
        self._rows += [strip[len(strip) // 2] for strip in strips]
        times = np.array([frame.time for frame in self._frames])
        until = np.inf if is_end else times[-1] - _DELAY
        recent = [item for item in passages if self._searched <= item.time < until]
        covers = _Covers.of(self._band, self._frames)
        self._crossings += covers.crossings(recent, times)
        traces = self._traces(covers, times) if len(self._crossings) >= _ENOUGH else []
        complete = [trace for trace in traces if self._searched <= trace.time < until]
        self._searched = until
        first = int(np.searchsorted(times, until - _DELAY))
        self._frames, self._rows = self._frames[first:], self._rows[first:]
        return complete

    def _traces(self, covers: _Covers, times: Float64Array) -> list[Trace]:
        """Return the traces in the frames at hand."""
        samples = self._band.samples
        covered = covers.mask(len(times), samples)
        places, widths, seconds, passed = np.array([astuple(item) for item in self._crossings]).T
        away = np.abs((np.arange(samples) + 0.5) / samples - places[:, np.newaxis])
        is_driven = (away <= widths[:, np.newaxis] / 2).any(axis=0)
        strip = np.moveaxis(np.array(self._rows), 2, 0).astype(np.float32, order="C")
        differs = _differences(strip, covered, times) > _DIFFERENT
        shape = int(np.median(widths) * samples / 4), int(np.median(seconds) / _step(times) / 4)
        kernel = np.ones((shape[1] | 1, shape[0] | 1), np.uint8)
        image = (differs & ~covered & is_driven).astype(np.uint8)
        closed = cv2.morphologyEx(image, cv2.MORPH_CLOSE, kernel) * ~covered
        _, labels, stats, _ = cv2.connectedComponentsWithStats(closed)
        shortest, longest = np.quantile(seconds, _SHORT, method="lower"), seconds.max()
        traces = []
        for label, (left, top, width, height, area) in enumerate(stats[1:].tolist(), start=1):
            middle = (left + width / 2) / samples
            near = np.argsort(np.abs(places - middle))[:_NEAR]
            usual, fraction = np.median(widths[near]) * samples, np.median(passed[near])
            lasted = height * _step(times)
            if (
                width >= _WIDTH * usual
                and _SECONDS * shortest <= lasted <= _LONGEST * longest
                and area >= _AREA * usual * shortest / _step(times)
            ):
                row = top + int(fraction * (height - 1))
                part = labels[max(top, row - height // 5) : row + height // 5 + 1] == label
                columns = np.flatnonzero(part.any(axis=0))
                place = (columns[0] + columns[-1] + 1) / 2 / samples
                time = round(float(times[top] + fraction * lasted), 3)
                traces.append(Trace(self._band, time, float(place)))
        return traces


def _step(times: Float64Array) -> float:
    """Return the usual duration of a frame, seconds."""
    return float(np.median(np.diff(times))) if len(times) > 1 else 1.0


def _differences(strip: Float32Array, covered: BoolArray, times: Float64Array) -> Float32Array:
    """Return how far each pixel is from the background, levels, `(frames, samples)`.

    The best of five places of the background counts. Changes of the light are taken off.
    """
    background = _backgrounds(strip, covered, times)
    light = _median((strip - background)[..., ::4], ~covered[:, ::4], axis=-1)
    strip = strip - np.clip(light, -_MAX_GAIN, _MAX_GAIN)
    padded = np.pad(background, ((0, 0), (0, 0), (_PLAY, _PLAY)), mode="edge")
    moved = (padded[..., first : first + strip.shape[-1]] for first in range(2 * _PLAY + 1))
    return reduce(np.minimum, (np.abs(strip - other).max(axis=0) for other in moved))


def _backgrounds(strip: Float32Array, covered: BoolArray, times: Float64Array) -> Float32Array:
    """Return the background of each frame: that of its second, `(3, frames, samples)`.

    Where a second has too few free frames, the background of the one before is used.
    """
    spread = np.linspace(0, len(times) - 1, 4 * _SAMPLES).astype(int)
    background = _median(strip[:, spread], ~covered[spread], axis=-2)
    backgrounds = np.empty_like(strip)
    for second in np.arange(times[0], times[-1] + 1):
        ends = np.searchsorted(times, (second - _WINDOW / 2, second + _WINDOW / 2))
        rows = np.unique(np.linspace(ends[0], ends[1] - 1, _SAMPLES).astype(int))
        is_free = ~covered[rows]
        latest = _median(strip[:, rows], is_free, axis=-2)
        has_enough = is_free.sum(axis=0) >= _SAMPLES / 4
        background = np.where(has_enough, latest, background)
        first, last = np.searchsorted(times, (second - 0.5, second + 0.5))
        backgrounds[:, first:last] = background
    return backgrounds


def _median(values: Float32Array, is_known: BoolArray, axis: int) -> Float32Array:
    """Return the median of the known values along an axis, which stays; 0 where there is none."""
    ordered = np.sort(np.where(is_known, values, np.inf), axis=axis)
    count = is_known.sum(axis=axis, keepdims=True)
    middle = np.take_along_axis(ordered, (np.maximum(count - 1, 0) // 2)[np.newaxis], axis=axis)
    return np.where(count, middle, np.float32(0))

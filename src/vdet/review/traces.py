"""Traces: what passes a line like a vehicle, and has no track.

The strip of a band is compared with its background, the median of a minute without the tracked
vehicles. What differs where vehicles drive, and is as large and lasts as long as the tracked
vehicles there, is a trace. It is a hint: nothing is counted by it.
"""

from collections import Counter, deque
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from functools import reduce

import cv2
import numpy as np

from vdet.boxes import BoolArray, Float32Array, Image, Int64Array
from vdet.errors import clock_text, quantity
from vdet.findings import Finding
from vdet.review.strips import Band, BandPassage
from vdet.track.track import FrameTracks
from vdet.traffic.counts import Counts, Trace

_SAMPLES = 64
"""Number of frames of which the median is the background."""
_PLAY = 2
"""Columns by which the background may move along the line."""
_MAX_LIGHT = 8
"""Maximum change of the light that is taken off a frame, levels."""
_DIFFERENT = 10
"""Minimum difference from the background, levels."""
_MARGIN = 0.1
"""Margin of tracked boxes that are left out, as a fraction of their sides."""
_WIDTH, _DURATION, _AREA = 0.45, 0.4, 0.15
"""Minimum width, duration and area of a trace, as fractions of those of tracked vehicles there."""
_LONGEST = 4
"""Maximum duration, as a multiple of the longest of tracked vehicles."""
_SHORT = 0.2
"""Quantile of the durations of tracked vehicles with which traces are compared: some stand."""
_NEAR = 5
"""Number of the nearest tracked vehicles with which a trace is compared."""
_ENOUGH, _LATEST = 2, 100
"""Minimum number of tracked vehicles that crossed, and number of the latest ones in use."""
_SHADED, _EVEN = 0.8, 0.08
"""Minimum fraction of a shadow that is darker by one factor in all channels, and the maximum
standard deviation of this factor. On thirty drawn cameras 439 of 480 missed vehicles have a trace
with them, and 455 without; the traces of a real clip, lower edges of tracked lorries, are gone.
"""
_GREY = 128
"""Blue and red of grey, levels."""
DELAY = 4.0
"""Seconds after which a trace is complete."""
_MANY = 0.05
"""Maximum number of traces for a note instead of a warning, as a fraction of the vehicles."""
_INTERVAL = 300
"""Seconds of the intervals in which traces are counted."""


@dataclass(frozen=True, slots=True)
class _StripPassage:
    """A tracked vehicle in a strip: position and width, columns, and number of frames.

    `passed` is when its foot passed, as a fraction of these frames.
    """

    position: float
    width: float
    frames: float
    passed: float


class TraceSearch:
    """Looks for the traces at a band, minute by minute; `number` is that of the band."""

    def __init__(self, number: int, band: Band) -> None:
        self._number = number
        self._band = band
        self._frames: list[FrameTracks] = []
        self._rows: list[Image] = []
        self._crossings: deque[_StripPassage] = deque(maxlen=_LATEST)
        self._searched = -np.inf

    def search(
        self,
        frames: Sequence[FrameTracks],
        strips: Sequence[Image],
        passages: Sequence[BandPassage],
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
        until = np.inf if is_end else times[-1] - DELAY
        ids = _ids(self._band, self._frames)
        for passage in passages:
            if self._searched <= passage.time < until and (ids == passage.id + 1).any():
                row = int(np.searchsorted(times, passage.time))
                position = passage.position * self._band.samples
                self._crossings.append(_crossing(ids == passage.id + 1, row, position))
        traces = []
        if len(self._crossings) >= _ENOUGH:
            for row, column in self._feet(ids == 0):
                position = round(float(column) / self._band.samples, 3)
                traces.append(
                    Trace(self._number, self._band.name, round(float(times[row]), 3), position)
                )
        complete = [trace for trace in traces if self._searched <= trace.time < until]
        self._searched = until
        first = int(np.searchsorted(times, until - DELAY))
        self._frames, self._rows = self._frames[first:], self._rows[first:]
        return complete

    def _feet(self, is_free: BoolArray) -> Iterator[tuple[int, float]]:
        """Yield the row and column of the foot of each trace in the frames at hand."""
        positions, widths, frames, passed = np.array([astuple(item) for item in self._crossings]).T
        away = np.abs(np.arange(self._band.samples) + 0.5 - positions[:, np.newaxis])
        is_driven = (away <= widths[:, np.newaxis] / 2).any(axis=0)
        difference, factors = _differences(self._rows, is_free)
        differs = is_free & is_driven & (difference > _DIFFERENT)
        gaps = np.ones((int(np.median(frames)) // 4 | 1, int(np.median(widths)) // 4 | 1), np.uint8)
        closed = cv2.morphologyEx(differs.astype(np.uint8), cv2.MORPH_CLOSE, gaps) * is_free
        _, labels, stats, _ = cv2.connectedComponentsWithStats(closed)
        shortest, longest = np.quantile(frames, _SHORT, method="lower"), frames.max()
        for label, (left, top, width, height, area) in enumerate(stats[1:].tolist(), start=1):
            near = np.argsort(np.abs(positions - left - width / 2))[:_NEAR]
            usual = np.quantile(widths[near], _SHORT, method="lower")
            is_large = width >= _WIDTH * usual and area >= _AREA * usual * shortest
            is_shadow = _are_shadow(factors[labels == label])
            if is_large and _DURATION * shortest <= height <= _LONGEST * longest and not is_shadow:
                row = top + int(np.median(passed[near]) * (height - 1))
                rows = labels[max(top, row - height // 5) : row + height // 5 + 1]
                columns = np.flatnonzero((rows == label).any(axis=0))
                yield row, (columns[0] + columns[-1] + 1) / 2


def _ids(band: Band, frames: Sequence[FrameTracks]) -> Int64Array:
    """Return the ids of the tracks whose boxes, with a margin, cover the samples of a band.

    The array is `(frames, samples)`, and has 0 where there is none, and else the id + 1.
    """
    tracks = [(row, track) for row, frame in enumerate(frames) for track in frame.tracks]
    corners = [(box.x1, box.y1, box.x2, box.y2) for box in (track.box for _, track in tracks)]
    boxes = np.array(corners, np.float64).reshape(-1, 2, 2)
    sides = _MARGIN * (boxes[:, 1] - boxes[:, 0])
    boxes += np.stack([-sides, sides], axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):  # the band may be level or upright
        along = band.samples * (boxes - band.start) / np.subtract(band.end, band.start)
    firsts = np.nanmax(along.min(axis=1), axis=1).clip(0, band.samples).astype(int)
    lasts = np.nanmin(along.max(axis=1), axis=1).clip(0, band.samples)
    ids = np.zeros((len(frames), band.samples), np.int64)
    for (row, track), first, last in zip(tracks, firsts, np.ceil(lasts).astype(int), strict=True):
        ids[row, first:last] = track.id + 1
    return ids


def _crossing(shown: BoolArray, row: int, position: float) -> _StripPassage:
    """Return how a vehicle crosses that covers a part of a strip, and whose foot is at a row."""
    rows = np.flatnonzero(shown.any(axis=1))
    width = shown.sum(axis=1).max() / (1 + 2 * _MARGIN)
    frames = (rows[-1] - rows[0] + 1) / (1 + 2 * _MARGIN)
    return _StripPassage(
        position, float(width), float(frames), float((row - rows[0]) / frames - _MARGIN)
    )


def _are_shadow(factors: Float32Array) -> bool:
    """Return whether pixels show a shadow on the road, by how they are darkened, `(n,)`.

    A shadow darkens all channels by one factor, and keeps the texture of the road. Source:
    Horprasert et al., "A Statistical Approach for Real-time Robust Background Subtraction and
    Shadow Detection", 1999; Prati et al., "Detecting Moving Shadows", 2003.
    """
    darkened = factors[factors < 1]
    return len(darkened) >= _SHADED * len(factors) and bool(darkened.std() <= _EVEN)


def _differences(rows: Sequence[Image], is_free: BoolArray) -> tuple[Float32Array, Float32Array]:
    """Return how far each pixel is from the background, levels, and by what factor it is darker.

    Both are `(frames, samples)`. The best of five positions of the background counts; the factor
    is infinite where the colour differs. Changes of the light are taken off.
    """
    strip = np.moveaxis(np.array(rows), 2, 0).astype(np.float32, order="C")
    spread = np.linspace(0, len(rows) - 1, _SAMPLES).astype(int)
    background = _median(strip[:, spread], is_free[spread], axis=-2)
    light = _median((strip - background)[..., ::4], is_free[:, ::4], axis=-1)
    strip -= np.clip(light, -_MAX_LIGHT, _MAX_LIGHT)
    padded = np.pad(background, ((0, 0), (0, 0), (_PLAY, _PLAY)), mode="edge")
    moved = (padded[..., first : first + strip.shape[-1]] for first in range(2 * _PLAY + 1))
    difference = reduce(np.minimum, (np.abs(strip - position).max(axis=0) for position in moved))
    factors = strip[0] / np.maximum(background[0], 1)
    chroma = strip[1:] - _GREY - factors * (background[1:] - _GREY)
    factors[np.abs(chroma).max(axis=0) > _DIFFERENT] = np.inf
    return difference, factors


def _median(values: Float32Array, is_valid: BoolArray, axis: int) -> Float32Array:
    """Return the median of the valid values along an axis, which stays; 0 where there is none."""
    masked = np.ma.array(values, mask=np.broadcast_to(~is_valid, values.shape))
    median = np.ma.median(masked, axis=axis, keepdims=True)  # type: ignore[no-untyped-call]
    return np.asarray(median.filled(0), np.float32)


def with_traces(counts: Counts, traces: tuple[Trace, ...]) -> Counts:
    """Return counts with traces, and a finding for each line or zone; a single trace is a note."""
    vehicles = Counter(event.name for event in counts.events)
    findings = []
    for name, number in Counter(trace.name for trace in traces).items():
        times = [trace.time for trace in traces if trace.name == name]
        starts = Counter(int(time // _INTERVAL) * _INTERVAL for time in times)
        [(start, most)] = starts.most_common(1)
        text = (
            f"{name}: {quantity(number, 'trace')} without a vehicle, and {vehicles[name]} counted; "
            f"{clock_text(start)} to {clock_text(start + _INTERVAL)}: {most}"
        )
        fraction = number / max(1, vehicles[name])
        is_many = number > 1 and fraction > _MANY
        spans = tuple((time, time) for time in times)
        findings.append(Finding("traces", text, spans, "warning" if is_many else "note", fraction))
    return replace(counts, traces=traces, findings=(*counts.findings, *findings))

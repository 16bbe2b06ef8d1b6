"""Strips: the photo finish of a line, which shows everything that crosses it; and their traces.

For each frame a band across the line is cut out along the way of the traffic, as wide as a vehicle
moves in a frame, and the bands are joined in the order of time. So each vehicle leaves its picture,
whether it was counted or not (slit-scan photography, as in finish cameras).

A trace is what passes a line like a vehicle, and has no track. The strip of a band is compared with
its background, the median of a minute without the tracked vehicles. What differs where vehicles
drive, and is as large and lasts as long as the tracked vehicles there, is a trace. It is a hint:
nothing is counted by it.
"""

from collections import Counter, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from statistics import median

import cv2
import numpy as np
from cv2.typing import MatLike

from vdet.boxes import BoolArray, Float32Array, Float64Array, Image, Int64Array
from vdet.errors import clock_text, quantity
from vdet.findings import Finding
from vdet.polygons import Point, meeting
from vdet.track.track import FrameTracks, Track
from vdet.traffic.counts import Counts, Trace
from vdet.traffic.crossings import Border, Line

_SAMPLES = 200, 260
"""Minimum and maximum number of samples along a line."""
_MAX_ROWS = 12
"""Maximum number of rows of a frame."""
_LONG = 1.8
"""How much longer than wide vehicles may be in a strip: on long lines they have few pixels."""
_NEAR = 0.06
"""Distance along a line, as a fraction of its length, at which a passage has little weight."""
_HISTORY = 0.4
"""Seconds over which the speed of a vehicle at a line is measured."""
_SLOW = 0.5
"""Pixels a frame assumed for standing vehicles, and where nothing has passed yet: twice that."""
_BACKGROUND = 64
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
_COMPARED = 5
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
class Band:
    """A line, or a side of a zone, of which there is a strip.

    Attributes
    ----------
    name, directions
        Of the line or zone; the first direction leads to its positive side.
    start, end
        Pixels of the frame.
    """

    name: str
    directions: tuple[str, str]
    start: Point
    end: Point

    @property
    def length(self) -> float:
        """Pixels."""
        return float(np.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1]))

    @property
    def is_upright(self) -> bool:
        """Whether it lies at the side of the traffic rather than across it."""
        return abs(self.end[1] - self.start[1]) > abs(self.end[0] - self.start[0])

    @property
    def samples(self) -> int:
        """Number of columns of its strip."""
        return int(np.clip(round(self.length), *_SAMPLES))


def bands_of(borders: Sequence[Border]) -> list[Band]:
    """Return the bands of lines, and of the sides of zones inside the frame."""
    bands = []
    for border in borders:
        sides = [(border.start, border.end)] if isinstance(border, Line) else border.inner_sides
        ways = (border.directions[0], border.directions[1])
        bands += [Band(border.name, ways, start, end) for start, end in sides]
    return bands


@dataclass(frozen=True, slots=True)
class BandPassage:
    """A track passes a band.

    Attributes
    ----------
    id, time
        Of the track; seconds.
    position
        Fraction of the length of the band, 0 to 1.
    velocity
        Movement of the foot, x and y, pixels a frame.
    width
        Of its box, pixels.
    """

    id: int
    time: float
    position: float
    velocity: Point
    width: float


class Passages:
    """Records where the feet of tracks pass bands, frame by frame.

    Attributes
    ----------
    bands, by_band
        The bands, and the passages of each, in order.
    """

    def __init__(self, bands: Sequence[Band]) -> None:
        self.bands = bands
        self._latest: dict[int, deque[tuple[FrameTracks, Track]]] = {}
        self.by_band: list[list[BandPassage]] = [[] for _ in bands]

    def add(self, frame: FrameTracks) -> None:
        """Add the tracks of the next frame."""
        shown = {track.id for track in frame.tracks}
        self._latest = {key: items for key, items in self._latest.items() if key in shown}
        for track in frame.tracks:
            latest = self._latest.setdefault(track.id, deque())
            latest.append((frame, track))
            while frame.time - latest[0][0].time > _HISTORY:
                latest.popleft()
            if len(latest) > 1:
                self._pass(latest)

    def _pass(self, latest: Sequence[tuple[FrameTracks, Track]]) -> None:
        """Add the passages between the last two of the latest frames with a track."""
        (first, start), (before, previous), (now, track) = latest[0], latest[-2], latest[-1]
        step, frames = (previous.foot, track.foot), now.index - first.index
        for band, passages in zip(self.bands, self.by_band, strict=True):
            way = meeting(step, (band.start, band.end))
            if way is not None:
                position = meeting((band.start, band.end), step) or 0.0
                x, y = (np.subtract(track.foot, start.foot) / frames).tolist()
                time = before.time + way * (now.time - before.time)
                passages.append(BandPassage(track.id, time, position, (x, y), track.box.width))


@dataclass(frozen=True, slots=True, eq=False)
class Sampling:
    """Where the pixels of a band lie in a frame, and in its chroma, as `cv2.remap` takes it.

    Attributes
    ----------
    rows
        Number of rows of a frame, the earliest first.
    is_upward
        Whether time should run up the strip, so that vehicles which come nearer stand upright.
    """

    rows: int
    is_upward: bool
    _full: tuple[MatLike, MatLike]
    _half: tuple[MatLike, MatLike]

    def cut(self, layers: Sequence[Image]) -> Image:
        """Return the band of a frame as luma, blue and red, uint8 `(rows, samples, 3)`.

        The layers are the frame, BGR, or its luma, blue and red.
        """
        first, *chroma = layers
        cut = _remapped(first, self._full)
        if not chroma:
            return np.asarray(cv2.cvtColor(cut, cv2.COLOR_BGR2YCrCb)[..., [0, 2, 1]], np.uint8)
        merged = cv2.merge([cut, *(_remapped(layer, self._half) for layer in chroma)])
        return np.asarray(merged, np.uint8)


def _remapped(layer: Image, maps: tuple[MatLike, MatLike]) -> Image:
    """Return the pixels of a layer that lie where two maps say."""
    cut = cv2.remap(layer, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(cut, np.uint8)


def sampling_of(band: Band, passages: Sequence[BandPassage]) -> Sampling:
    """Return where the pixels of a band lie, for the traffic that passed it.

    At each position, the band follows the mean way of the traffic there, of the direction that most
    take, and is as wide as that moves in a frame. It has a row for each pixel of that, or fewer on
    long lines, where vehicles would be too long.
    """
    count, along = band.samples, np.subtract(band.end, band.start)
    positions = (np.arange(count) + 0.5) / count
    velocities = _velocities(positions, passages, along)
    points = np.array(band.start) + positions[:, np.newaxis] * along
    speeds = [float(np.hypot(*passage.velocity)) for passage in passages] or [2 * _SLOW]
    rows = int(np.clip(round(median(speeds) * min(1, _LONG * count / band.length)), 1, _MAX_ROWS))
    offsets = 0.5 - (np.arange(rows) + 0.5) / rows  # what is ahead has passed earlier
    x, y = np.moveaxis(points + offsets[:, np.newaxis, np.newaxis] * velocities, 2, 0)
    is_upward = bool(np.median(velocities[:, 1]) > 0)
    full, half = (
        cv2.convertMaps(a.astype(np.float32), b.astype(np.float32), cv2.CV_16SC2)
        for a, b in ((x, y), ((x - 0.5) / 2, (y - 0.5) / 2))
    )
    return Sampling(rows, is_upward, full, half)


def _velocities(
    positions: Float64Array, passages: Sequence[BandPassage], along: Float64Array
) -> Float64Array:
    """Return the movement in a frame at each position, pixels, `(n, 2)`."""
    normal = np.array([along[1], -along[0]]) / np.hypot(*along)
    if not passages:
        return np.tile(2 * _SLOW * normal, (len(positions), 1))
    measured = np.array([passage.velocity for passage in passages])
    away = (positions[:, np.newaxis] - [passage.position for passage in passages]) / _NEAR
    weights = 1 / (1 + away**4)
    sides = np.sign(measured @ normal)
    most = np.where(weights @ sides >= 0, 1, -1)[:, np.newaxis]
    weights *= sides == most
    means = weights @ measured / np.maximum(weights.sum(axis=1, keepdims=True), 1e-9)
    speeds = np.hypot(*means.T)[:, np.newaxis]
    return np.asarray(np.where(speeds < _SLOW, most * _SLOW * normal, means))


class TraceSearch:
    """Looks for the traces at a band, minute by minute; `number` is that of the band."""

    def __init__(self, number: int, band: Band) -> None:
        self._number = number
        self._band = band
        self._frames: list[FrameTracks] = []
        self._rows: list[Image] = []
        self._crossings: deque[Float64Array] = deque(maxlen=_LATEST)
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
        positions, widths, frames, passed = np.array(self._crossings).T
        away = np.abs(np.arange(self._band.samples) + 0.5 - positions[:, np.newaxis])
        is_driven = (away <= widths[:, np.newaxis] / 2).any(axis=0)
        difference, factors = _differences(self._rows, is_free)
        differs = is_free & is_driven & (difference > _DIFFERENT)
        gaps = np.ones((int(np.median(frames)) // 4 | 1, int(np.median(widths)) // 4 | 1), np.uint8)
        closed = cv2.morphologyEx(differs.astype(np.uint8), cv2.MORPH_CLOSE, gaps) * is_free
        _, labels, stats, _ = cv2.connectedComponentsWithStats(closed)
        shortest, longest = np.quantile(frames, _SHORT, method="lower"), frames.max()
        for label, (left, top, width, height, area) in enumerate(stats[1:].tolist(), start=1):
            near = np.argsort(np.abs(positions - left - width / 2))[:_COMPARED]
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


def _crossing(shown: BoolArray, row: int, position: float) -> Float64Array:
    """Return how a vehicle crosses that covers a part of a strip, and whose foot is at a row.

    The array has its position and width, columns, its number of frames, and when its foot passed,
    as a fraction of these frames.
    """
    rows = np.flatnonzero(shown.any(axis=1))
    width = shown.sum(axis=1).max() / (1 + 2 * _MARGIN)
    frames = (rows[-1] - rows[0] + 1) / (1 + 2 * _MARGIN)
    return np.array([position, width, frames, (row - rows[0]) / frames - _MARGIN])


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
    spread = np.linspace(0, len(rows) - 1, _BACKGROUND).astype(int)
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

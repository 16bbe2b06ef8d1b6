"""The speed of each vehicle on the road plane.

1. A vehicle stands at its ground point, the middle of the lower edge of its box, which the plane
   maps to a position in metres.
2. This is its nearest point. Its middle is half its extent farther away, which depends on where it
   heads; its length follows from the width of its box.
3. Velocity is the slope of a straight line, fitted by weighted least squares to the positions of
   `WINDOW` seconds (Cleveland 1979 without the robust steps). Positions are weighted by the
   precision of a row of pixels there. Positions far off the line are dropped, and the line is
   fitted again.
4. The standard deviation has two parts. One follows from the scatter about the lines; neighbouring
   positions have similar errors, so they count as fewer. The other applies to the whole vehicle:
   the box may end too low or too high, and the plane is only as exact as the pixels it was fitted
   to.
"""

import math
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

from vdet.boxes import Float64Array
from vdet.findings import Finding
from vdet.lanes.camera import Ground
from vdet.track.track import FrameTracks
from vdet.traffic.counts import Counts

WINDOW = 1.0
"""Length of the part of a path that a velocity is fitted to, seconds."""
MIN_SECONDS = 0.5
"""Minimum duration of a path with a speed, seconds."""
KMH = 3.6
"""km/h in 1 m/s."""

_SLIMNESS = 0.4
"""Width of a vehicle as a fraction of its length."""
_LENGTHS = 1.5, 20.0
"""Lengths of vehicles, metres."""
_CAR_LENGTHS = 2.5, 8.0
"""Median lengths of cars that are possible, with the error of boxes, metres."""
_MIN_CARS = 5
"""Minimum number of cars for a median."""
_OUTLIERS = 0.1, 4.0
"""Maximum distance of a position from the line: in heights of the box, or in median distances; the
larger one applies.
"""
_BOTTOM_ERROR = 0.03
"""Standard deviation of the height at which a box ends, as a fraction of its height."""
_MAX_CORRELATION = 0.9
"""Maximum correlation of neighbouring positions that is assumed."""
_MOVES = 1.0
"""Minimum speed at which the heading of a vehicle is known, m/s."""
_MIN_DISTANCE = 1.0
"""Minimum distance for a relative error, metres."""
_GONE = 10.0
"""Seconds after its last frame at which a vehicle is measured."""
_SPACING = 0.2
"""Minimum seconds between the speeds that are kept."""
_AROUND = np.array([(0, 0), (0, 1), (1, 0)])
"""Offsets to a pixel, the one above it and the one to its left."""
_COLUMNS = 5  # numbers stored for a vehicle in a frame
_NOTHING = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Speeds:
    """The positions and speeds of a vehicle at some `times`, seconds, float64 `(n,)`.

    Attributes
    ----------
    positions
        As measured, metres, `(n, 2)`.
    speeds, deviations
        Smoothed speeds, and their standard deviations from the scatter of the positions, m/s.
    common
        Relative standard deviation that all speeds of the vehicle share.
    length
        Length of the vehicle by the width of its box, metres; NaN if it never moves.
    """

    times: Float64Array
    positions: Float64Array
    speeds: Float64Array
    deviations: Float64Array
    common: float
    length: float

    @property
    def metres(self) -> float:
        """Length of the path."""
        return float(self._covered.sum())

    def quantile(self, fraction: float) -> float:
        """Return the speed below which the vehicle covers this fraction of its path, m/s."""
        order = np.argsort(self.speeds)
        gone = np.cumsum(self._covered[order])
        if not gone[-1]:
            return 0.0
        return float(self.speeds[order][np.searchsorted(gone, fraction * gone[-1])])

    @property
    def deviation(self) -> float:
        """The standard deviation of the median speed, m/s."""
        windows = max(1.0, float(self._steps.sum()) / WINDOW)
        scatter = np.median(self.deviations) / np.sqrt(windows)
        return float(np.hypot(scatter, self.common * self.quantile(0.5)))

    def at(self, time: float) -> tuple[float, float] | None:
        """Return the speed and its standard deviation at a time, m/s; None if unknown."""
        after = int(np.searchsorted(self.times, time))
        if not self.times[0] <= time <= self.times[-1] or not self._steps[after]:
            return None
        speed = float(np.interp(time, self.times, self.speeds))
        scatter = float(np.interp(time, self.times, self.deviations))
        return speed, float(np.hypot(scatter, self.common * speed))

    def between(self, first: float, last: float) -> float | None:
        """Return the mean speed between the positions at two times, m/s; None if one is unknown.

        It uses only these two positions, so it checks the smoothed speeds.
        """
        if not self.times[0] <= first < last <= self.times[-1]:
            return None
        ends = [np.interp((first, last), self.times, item) for item in self.positions.T]
        return float(np.hypot(*np.diff(ends)[:, 0])) / (last - first)

    @property
    def _covered(self) -> Float64Array:
        """Metres covered at each time: half of those to the times before and after it."""
        return np.asarray(self.speeds * (self._steps[:-1] + self._steps[1:]) / 2, np.float64)

    @property
    def _steps(self) -> Float64Array:
        """Seconds before and after each time, `(n + 1,)`; 0 where the vehicle was away."""
        steps = np.diff(self.times, prepend=self.times[0], append=self.times[-1])
        return np.where(steps < _GONE, steps, 0.0)

    def then(self, later: "Speeds") -> "Speeds":
        """Return these speeds of a vehicle, and those after it returned."""
        names = "times", "positions", "speeds", "deviations"
        arrays = {
            name: np.concatenate([getattr(self, name), getattr(later, name)]) for name in names
        }
        length = float(np.fmax(self.length, later.length))
        return Speeds(**arrays, common=max(self.common, later.common), length=length)


class SpeedMeter:
    """Measures the speeds of the vehicles of a video, frame by frame.

    Parameters
    ----------
    ground
        The road plane.
    width, height
        Size of the frames, pixels.
    """

    def __init__(self, ground: Ground, width: int, height: int) -> None:
        self.ground = ground
        self._size = width, height
        self._rows: dict[int, array[float]] = {}
        self._gone: dict[int, Speeds | None] = {}  # of vehicles that are no longer shown

    def add(self, frame: FrameTracks) -> None:
        """Add the next frame. Predicted boxes, and those cut off by the frame, are omitted."""
        for track in frame.tracks:
            box = track.box
            if track.state != "predicted" and not box.cut_by(self._size).hide_foot:
                row = frame.time, *track.foot, box.width, box.height
                self._rows.setdefault(track.id, array("d")).extend(row)
        oldest = frame.time - _GONE
        for number in [key for key, rows in self._rows.items() if rows[-_COLUMNS] < oldest]:
            self._gone[number] = self._measured(number)
            del self._rows[number]

    def speeds(self) -> dict[int, Speeds]:
        """Return the known speeds so far, by the ids of the vehicles."""
        every = self._gone | {number: self._measured(number) for number in self._rows}
        return {number: speeds for number, speeds in every.items() if speeds}

    def _measured(self, number: int) -> Speeds | None:
        rows = np.array(self._rows[number]).reshape(-1, _COLUMNS)
        latest, earlier = measure(self.ground, rows), self._gone.get(number)
        return earlier.then(latest) if earlier and latest else latest or earlier


def with_speeds(counts: Counts, meter: SpeedMeter | None) -> Counts:
    """Return the counts of a video with the speeds of its vehicles at their events."""
    if not meter:
        return counts
    by_track = meter.speeds()
    latest: dict[int, float] = {}
    events = list(counts.events)
    for row, event in enumerate(events):
        if speeds := by_track.get(event.id):
            speed, deviation = speeds.at(event.time) or (None, None)
            mean = speeds.between(latest.get(event.id, math.inf), event.time)
            events[row] = replace(
                event, speed=_kmh(speed), speed_sd=_kmh(deviation), mean_speed=_kmh(mean)
            )
            latest[event.id] = event.time
    cars = {event.id for event in counts.events if event.class_name == "car"} & by_track.keys()
    lengths = _length_findings([by_track[number].length for number in cars])
    return replace(counts, events=tuple(events), findings=(*counts.findings, *lengths))


def _length_findings(lengths: Sequence[float]) -> Iterator[Finding]:
    """Yield a finding if cars cannot have these lengths, metres: the points are wrong."""
    moved = [length for length in lengths if not math.isnan(length)]
    low, high = _CAR_LENGTHS
    if len(moved) >= _MIN_CARS and not low <= (length := median(moved)) <= high:
        text = f"camera.ground: cars are {length:.1f} m long by these points; check their metres"
        yield Finding("ground", text)


def _kmh(speed: float | None) -> float | None:
    return None if speed is None else round(KMH * speed, 1)


def measure(ground: Ground, rows: Float64Array) -> Speeds | None:
    """Return the speeds of a vehicle; None if too little of its path is in the calibrated area.

    `rows` are time, x and y of the ground point, width and height of the box, `(n, 5)`.
    """
    rows = rows[np.isfinite(_Geometry.of(ground, rows).weights)]
    if len(rows) < 3 or rows[-1, 0] - rows[0, 0] < MIN_SECONDS:
        return None
    whole = _Geometry.of(ground, rows)
    _, fitted, _ = whole.lines(whole.positions)
    off = np.hypot(*(whole.positions - fitted).T) * np.sqrt(whole.weights)  # in heights of the box
    rows = rows[off <= max(_OUTLIERS[0], _OUTLIERS[1] * float(np.median(off)))]
    clean = _Geometry.of(ground, rows)
    rough, *_ = clean.lines(clean.positions)
    length, middles, along = math.nan, clean.positions, clean.along(rough)
    if along is not None:
        length = clean.length(along)
        middles = clean.middles(along, length)
    velocities, _, deviations = clean.lines(middles)
    speeds, times = np.hypot(*velocities.T), clean.times
    at = np.arange(times[0], times[-1] + _SPACING, _SPACING)
    kept = np.unique(np.minimum(np.searchsorted(times, at), len(times) - 1))
    return Speeds(
        times=times[kept],
        positions=middles[kept],
        speeds=speeds[kept],
        deviations=deviations[kept],
        common=_common(ground, rows),
        length=length,
    )


def _common(ground: Ground, rows: Float64Array) -> float:
    """Return the relative standard deviation of all speeds of a vehicle.

    A box that ends too low moves the first and the last position; the difference is false movement.
    """
    first, last = rows[[0, -1], 1:3]
    low = [(0, _BOTTOM_ERROR * height) for height in rows[[0, -1], 4]]
    positions = ground.metres(np.array([first, last, first + low[0], last + low[1]]))
    driven, moved = positions[1] - positions[0], positions[3] - positions[2]
    length = max(float(np.hypot(*driven)), _MIN_DISTANCE)
    box = float(np.hypot(*(moved - driven))) / length
    return math.hypot(0.0 if math.isnan(box) else box, ground.scale_error)


@dataclass(frozen=True, slots=True, eq=False)
class _Geometry:
    """The `positions` of a vehicle in metres, `(n, 2)`, and the geometry of the pixels there.

    `depth` is the unit vector across the rows of pixels, away from the camera. `away` points along
    a column of pixels, and is 1 m deep. Both are `(n, 2)`. `widths` are the widths of the box in
    metres, `weights` the weights of the positions, `(n,)`.
    """

    times: Float64Array
    positions: Float64Array
    depth: Float64Array
    away: Float64Array
    widths: Float64Array
    weights: Float64Array

    @classmethod
    def of(cls, ground: Ground, rows: Float64Array) -> "_Geometry":
        """Return the geometry for all `rows` of `measure`; unknown weights are NaN."""
        around = rows[:, 1:3] - _AROUND[:, np.newaxis]
        positions, above, left = ground.metres(around.reshape(-1, 2)).reshape(around.shape)
        away, beside = above - positions, left - positions
        pixel = np.hypot(*beside.T)
        depth = np.column_stack([-beside[:, 1], beside[:, 0]]) / pixel[:, None]
        row = np.sum(depth * away, axis=1)[:, None]
        weights = 1 / (np.abs(row[:, 0]) * rows[:, 4]) ** 2
        away, depth = away / np.abs(row), depth * np.sign(row)
        return cls(rows[:, 0], positions, depth, away, pixel * rows[:, 3], weights)

    def middles(self, along: Float64Array, length: float) -> Float64Array:
        """Return the centres of a vehicle of this length on the road, metres, `(n, 2)`."""
        across = np.sqrt(np.maximum(0, 1 - along**2))
        extent = np.clip(length, *_LENGTHS) * (along + _SLIMNESS * across)
        return np.asarray(self.positions + self.away * extent[:, None] / 2)

    def length(self, along: Float64Array) -> float:
        """Return the vehicle's length by the widths of its box, metres."""
        across = np.sqrt(np.maximum(0, 1 - along**2))
        return float(np.median(self.widths / (across + _SLIMNESS * along)))

    def along(self, velocities: Float64Array) -> Float64Array | None:
        """Return how much of its heading is away from the camera, 0 to 1 `(n,)`; None if unknown.

        While it stands, its heading is interpolated between those before and after.
        """
        speeds = np.hypot(*velocities.T)
        moves = speeds >= _MOVES
        if not moves.any():
            return None
        along = np.abs(np.sum(velocities * self.depth, axis=1))[moves] / speeds[moves]
        return np.asarray(np.interp(self.times, self.times[moves], along))

    def lines(self, positions: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
        """Fit a straight line to the positions of the window around each time.

        Returns
        -------
        velocities
            float64 `(n, 2)`, m/s.
        fitted
            float64 `(n, 2)`: the positions on the lines, metres.
        deviations
            float64 `(n,)`: standard deviations of the speeds, m/s.
        """
        weights = self.weights
        t, origin = self.times - self.times[0], positions.mean(axis=0)
        starts = np.clip(t - WINDOW / 2, 0, max(0.0, t[-1] - WINDOW))
        first = np.searchsorted(t, starts - _NOTHING)
        end = np.searchsorted(t, starts + WINDOW + _NOTHING)

        def total(values: Float64Array) -> Float64Array:
            sums = np.concatenate([[0], np.cumsum(values)])
            return np.asarray(sums[end] - sums[first])

        weight = total(weights)
        middle = total(weights * t) / weight
        spread = np.maximum(total(weights * t**2) - weight * middle**2, _NOTHING)
        velocities, fitted = np.empty_like(positions), np.empty_like(positions)
        for axis, x in enumerate((positions - origin).T):
            mean = total(weights * x) / weight
            velocities[:, axis] = (total(weights * t * x) - weight * middle * mean) / spread
            fitted[:, axis] = origin[axis] + mean + velocities[:, axis] * (t - middle)
        heading = velocities / np.maximum(np.hypot(*velocities.T), _NOTHING)[:, None]
        off = np.sum((positions - fitted) * heading, axis=1) * np.sqrt(weights)
        products = float(np.sum(off[1:] * off[:-1])) / max(float(np.sum(off**2)), _NOTHING)
        correlation = min(max(0.0, products), _MAX_CORRELATION)
        variance = np.mean(off**2) * (1 + correlation) / (1 - correlation)
        return velocities, fitted, np.sqrt(variance / spread)

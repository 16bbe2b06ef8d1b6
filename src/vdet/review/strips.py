"""Strips: the photo finish of a line, which shows everything that crosses it.

For each frame a band across the line is cut out along the way of the traffic, as wide as a vehicle
moves in a frame, and the bands are joined in the order of time. So each vehicle leaves its picture,
whether it was counted or not (slit-scan photography, as in finish cameras).
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Float64Array, Image
from vdet.polygons import Point, meeting
from vdet.track.track import FrameTracks, Track
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


@dataclass(frozen=True, slots=True)
class _Foot:
    """The foot of a track in a frame: number of the frame, seconds, pixels."""

    index: int
    time: float
    point: Point


class Passages:
    """Records where the feet of tracks pass bands, frame by frame.

    Attributes
    ----------
    by_band
        The passages of each band, in order.
    """

    def __init__(self, bands: Sequence[Band]) -> None:
        self._bands = bands
        self._feet: dict[int, deque[_Foot]] = {}
        self.by_band: list[list[BandPassage]] = [[] for _ in bands]

    def add(self, frame: FrameTracks) -> None:
        """Add the tracks of the next frame."""
        shown = {track.id for track in frame.tracks}
        self._feet = {key: feet for key, feet in self._feet.items() if key in shown}
        for track in frame.tracks:
            feet = self._feet.setdefault(track.id, deque())
            feet.append(_Foot(frame.index, frame.time, track.foot))
            while frame.time - feet[0].time > _HISTORY:
                feet.popleft()
            if len(feet) > 1:
                self._pass(track, feet)

    def _pass(self, track: Track, feet: Sequence[_Foot]) -> None:
        before, now = feet[-2], feet[-1]
        step, frames = (before.point, now.point), now.index - feet[0].index
        for band, passages in zip(self._bands, self.by_band, strict=True):
            way = meeting(step, (band.start, band.end))
            if way is not None:
                position = meeting((band.start, band.end), step) or 0.0
                x, y = (np.subtract(now.point, feet[0].point) / frames).tolist()
                time = before.time + way * (now.time - before.time)
                passages.append(BandPassage(track.id, time, position, (x, y), track.box.width))


@dataclass(frozen=True, slots=True, eq=False)
class _Map:
    """Where pixels lie in a layer, in the form that `cv2.remap` reads fastest."""

    pixels: npt.NDArray[np.int16]
    fractions: npt.NDArray[np.uint16]

    @classmethod
    def of(cls, x: Float64Array, y: Float64Array) -> "_Map":
        maps = cv2.convertMaps(x.astype(np.float32), y.astype(np.float32), cv2.CV_16SC2)
        return cls(np.asarray(maps[0], np.int16), np.asarray(maps[1], np.uint16))

    def cut(self, layer: Image) -> Image:
        """Return the pixels of a layer."""
        edge = cv2.BORDER_REPLICATE
        cut = cv2.remap(layer, self.pixels, self.fractions, cv2.INTER_LINEAR, borderMode=edge)
        return np.asarray(cut, np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class Sampling:
    """Where the pixels of a band lie in a frame.

    Attributes
    ----------
    rows
        Number of rows of a frame, the earliest first.
    is_upward
        Whether time should run up the strip, so that vehicles which come nearer stand upright.
    """

    rows: int
    is_upward: bool
    _full: _Map
    _half: _Map

    @classmethod
    def of(cls, x: Float64Array, y: Float64Array, *, is_upward: bool) -> "Sampling":
        """Sample at x and y, `(rows, samples)` each, pixels of the frame."""
        half = _Map.of((x - 0.5) / 2, (y - 0.5) / 2)
        return cls(len(x), is_upward, _Map.of(x, y), half)

    def cut(self, layers: Sequence[Image]) -> Image:
        """Return the band of a frame as luma, blue and red, uint8 `(rows, samples, 3)`.

        The layers are the frame, BGR, or its luma, blue and red.
        """
        first, *chroma = layers
        cut = self._full.cut(first)
        if not chroma:
            return np.asarray(cv2.cvtColor(cut, cv2.COLOR_BGR2YCrCb)[..., [0, 2, 1]], np.uint8)
        merged = cv2.merge([cut, *map(self._half.cut, chroma)])
        return np.asarray(merged, np.uint8)


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
    return Sampling.of(x, y, is_upward=is_upward)


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

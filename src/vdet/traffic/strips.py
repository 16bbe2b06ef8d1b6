"""Strips: the photo finish of a line, which shows everything that crosses it.

For each frame a band across the line is cut out along the way of the traffic, as wide as a vehicle
moves in a frame, and the bands are joined in the order of time. So each vehicle leaves its picture,
whether it was found or not (slit-scan photography, as in finish cameras).
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Float64Array, Image
from vdet.media import Picture
from vdet.polygons import Point, meeting
from vdet.track.track import FrameTracks
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
    """A line, or a side of a zone, whose strip is made.

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
class Passage:
    """A track passes a band.

    Attributes
    ----------
    id, time
        Of the track; seconds.
    place
        Fraction of the length of the band, 0 to 1.
    velocity
        Movement of the foot, x and y, pixels a frame.
    """

    id: int
    time: float
    place: float
    velocity: Point


class Passages:
    """Finds where the feet of tracks pass bands, frame by frame.

    Attributes
    ----------
    found
        The passages of each band, in order.
    """

    def __init__(self, bands: Sequence[Band]) -> None:
        self._bands = bands
        self._feet: dict[int, deque[tuple[int, float, Point]]] = {}
        self.found: list[list[Passage]] = [[] for _ in bands]

    def add(self, frame: FrameTracks) -> None:
        """Add the tracks of the next frame."""
        shown = {track.id for track in frame.tracks}
        self._feet = {key: feet for key, feet in self._feet.items() if key in shown}
        for track in frame.tracks:
            feet = self._feet.setdefault(track.id, deque())
            feet.append((frame.index, frame.time, track.foot))
            while frame.time - feet[0][1] > _HISTORY:
                feet.popleft()
            if len(feet) > 1:
                self._pass(track.id, frame.time, feet)

    def _pass(self, key: int, time: float, feet: Sequence[tuple[int, float, Point]]) -> None:
        (first, _, oldest), (_, before, a), (last, _, b) = feet[0], feet[-2], feet[-1]
        for band, found in zip(self._bands, self.found, strict=True):
            way = meeting((a, b), (band.start, band.end))
            if way is not None:
                place = meeting((band.start, band.end), (a, b)) or 0.0
                x, y = ((new - old) / (last - first) for new, old in zip(b, oldest, strict=True))
                found.append(Passage(key, before + way * (time - before), place, (x, y)))


@dataclass(frozen=True, slots=True, eq=False)
class Sampling:
    """Where the pixels of a band lie: float32 `(rows, samples)` each, pixels of the frame.

    `rows` belong to one frame, the earliest first. `is_upward` says whether time should run up the
    strip, so that vehicles which come nearer stand upright.
    """

    x: npt.NDArray[np.float32]
    y: npt.NDArray[np.float32]
    is_upward: bool

    @property
    def rows(self) -> int:
        """Number of rows of a frame."""
        return len(self.x)

    def cut(self, layers: Sequence[Image], origin: Point = (0, 0)) -> Image:
        """Return the band of a frame, uint8 `(rows, samples, 3)`.

        Parameters
        ----------
        layers
            The frame, BGR, or its luma, blue and red: so they are the channels of the band.
        origin
            The pixel of the frame at which the layers begin; even numbers.
        """
        x, y = self.x - np.float32(origin[0]), self.y - np.float32(origin[1])
        luma, *chroma = layers
        cut = _sampled(luma, x, y)
        if not chroma:
            return cut
        x, y = x * _HALF - _HALF / 2, y * _HALF - _HALF / 2
        return np.dstack([cut, *(_sampled(layer, x, y) for layer in chroma)])


_HALF = np.float32(0.5)


def _sampled(image: Image, x: npt.NDArray[np.float32], y: npt.NDArray[np.float32]) -> Image:
    edge = cv2.BORDER_REPLICATE
    return np.asarray(cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=edge), np.uint8)


def layers_of(picture: Picture) -> tuple[Image, ...]:
    """Return luma, blue and red of a picture that consists of planes, else its BGR image."""
    return picture.planes.layers if picture.planes else (picture.image,)


def sampling_of(band: Band, passages: Sequence[Passage]) -> Sampling:
    """Return where the pixels of a band lie, for the traffic that passed it.

    At each place the band follows the mean way of the traffic there, of the direction that most
    take, and is as wide as that moves in a frame. It has a row for each pixel of that, or fewer on
    long lines, where vehicles would be too long.
    """
    count, along = band.samples, np.subtract(band.end, band.start)
    places = (np.arange(count) + 0.5) / count
    velocities = _velocities(places, passages, along)
    points = np.array(band.start) + places[:, np.newaxis] * along
    speeds = [float(np.hypot(*passage.velocity)) for passage in passages] or [2 * _SLOW]
    rows = int(np.clip(round(median(speeds) * min(1, _LONG * count / band.length)), 1, _MAX_ROWS))
    offsets = 0.5 - (np.arange(rows) + 0.5) / rows  # what is ahead has passed earlier
    x, y = np.moveaxis(points + offsets[:, np.newaxis, np.newaxis] * velocities, 2, 0)
    is_upward = bool(np.median(velocities[:, 1]) > 0)
    return Sampling(x.astype(np.float32), y.astype(np.float32), is_upward)


def _velocities(
    places: Float64Array, passages: Sequence[Passage], along: Float64Array
) -> Float64Array:
    """Return the movement in a frame at each place, pixels, `(n, 2)`."""
    normal = np.array([along[1], -along[0]]) / np.hypot(*along)
    if not passages:
        return np.tile(2 * _SLOW * normal, (len(places), 1))
    own = np.array([passage.velocity for passage in passages])
    away = (places[:, np.newaxis] - [passage.place for passage in passages]) / _NEAR
    weights = 1 / (1 + away**4)
    sides = np.sign(own @ normal)
    most = np.where(weights @ sides >= 0, 1, -1)[:, np.newaxis]
    weights *= sides == most
    means = weights @ own / np.maximum(weights.sum(axis=1, keepdims=True), 1e-9)
    speeds = np.hypot(*means.T)[:, np.newaxis]
    return np.asarray(np.where(speeds < _SLOW, most * _SLOW * normal, means))


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """The part of a frame around a band, as layers for `Sampling.cut`, and their origin."""

    layers: tuple[Image, ...]
    origin: Point

    @classmethod
    def of(cls, band: Band, picture: Picture) -> "Surroundings":
        """Copy what lies within a twelfth of the frame's height of a band."""
        margin = picture.height / 12
        xs, ys = (sorted(values) for values in zip(band.start, band.end, strict=True))
        left, top = (max(0, int(values[0] - margin)) // 2 * 2 for values in (xs, ys))
        right, bottom = (int(values[1] + margin) + 2 for values in (xs, ys))
        full, *half = layers_of(picture)
        parts = [full[top:bottom, left:right]]
        parts += [layer[top // 2 : bottom // 2 + 1, left // 2 : right // 2 + 1] for layer in half]
        return cls(tuple(part.copy() for part in parts), (left, top))

    @property
    def nbytes(self) -> int:
        """Size of the layers, bytes."""
        return sum(layer.nbytes for layer in self.layers)

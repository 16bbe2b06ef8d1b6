"""The road plane from traffic: vanishing points of straight paths, and one known length.

Vehicles on parallel ways meet at a vanishing point. Two points of ways at a right angle give the
focal length and the horizon (Caprile and Torre 1990), a length gives the scale. Where the focal
length is known, one point is enough for a camera that does not roll. The principal point is taken
as the middle of the frame.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, islice

import numpy as np

from vdet.boxes import BoolArray, Float64Array
from vdet.errors import ConfigError
from vdet.polygons import Segment

_STRAIGHT = 0.01
"""Largest width of a straight path, as a share of its length."""
_LEAST = 3
"""Least number of paths that meet at a vanishing point."""
_TRIED = 2000
"""Number of pairs of paths whose crossing is tried."""
_OFF = math.radians(1.5)
"""Largest angle between a path and the way to its vanishing point."""
_OTHER = math.radians(10)
"""Least angle between the ways of two streams in the picture."""
_FOCAL = 0.3, 10.0
"""Limits of a focal length, in widths of the frame."""
_DEEPEST = 6.0
"""Farthest edge of the area, in distances of its nearest edge."""


@dataclass(frozen=True, slots=True)
class TrafficPlane:
    """Four points around the traffic in pixels and metres, `(4, 2)` each, and the camera.

    `focal` is in pixels, `above_ground` in metres.
    """

    pixels: Float64Array
    metres: Float64Array
    focal: float
    above_ground: float


def traffic_plane(
    paths: Sequence[Float64Array],
    known: tuple[Segment, float],
    size: tuple[int, int],
    focal: float | None = None,
) -> TrafficPlane:
    """Return the road plane.

    Parameters
    ----------
    paths
        Points `(n, 2)` of the way of each vehicle, pixels.
    known
        Two points on the road, pixels, and their distance in metres.
    size
        Width and height of the frames, pixels.
    focal
        Focal length in pixels; None to compute it from two streams.

    Raises
    ------
    ConfigError
        The traffic does not give a plane; the message says why, and what to do.
    """
    middle = np.array(size) / 2
    lines = _straight(paths, middle)
    first, fits = _vanishing_point(lines)
    if focal is None:
        second, focal = _second(lines, first, fits, size[0])
        across = second / (focal, focal, 1)
    else:
        across = np.array([1.0, 0, 0])
    along = first / (focal, focal, 1)
    normal = np.cross(along, across)
    normal /= np.linalg.norm(normal) * (1 if normal[1] > 0 else -1)
    along /= np.linalg.norm(along)
    axes = np.stack([np.cross(along, normal), along])

    def place(pixels: Float64Array) -> Float64Array:
        rays = np.column_stack([(pixels - middle) / focal, np.ones(len(pixels))])
        depths = rays @ normal
        if not np.all(depths > 0):
            raise ConfigError("the known length reaches above the horizon; give one on the road")
        return np.asarray(rays / depths[:, None] @ axes.T, np.float64)

    ends = place(np.array(known[0], np.float64))
    scale = known[1] / float(np.hypot(*(ends[1] - ends[0])))
    points = np.concatenate(list(paths))
    left, top = points.min(axis=0)
    right, bottom = np.minimum(points.max(axis=0), size)
    # A ray at `deepest` of the horizon's angle; rows count from the middle of the frame.
    x, lowest = (left + right) / 2 - middle[0], bottom - middle[1]
    horizon = -(normal[0] * x + normal[2] * focal) / normal[1]
    top = max(top, middle[1] + horizon + (lowest - horizon) / _DEEPEST)
    corners = np.array([(left, bottom), (right, bottom), (right, top), (left, top)])
    return TrafficPlane(corners, scale * place(corners), focal, scale)


@dataclass(frozen=True, slots=True, eq=False)
class _Lines:
    """Straight paths: their `middles` and unit `ways`, `(n, 2)`, pixels from the frame's middle."""

    middles: Float64Array
    ways: Float64Array
    lengths: Float64Array

    def only(self, rows: BoolArray) -> "_Lines":
        return _Lines(self.middles[rows], self.ways[rows], self.lengths[rows])

    def angles(self, point: Float64Array) -> Float64Array:
        """Return the angles between the lines and the ways to a homogeneous point."""
        to = point[:2] - self.middles * point[2]
        sines = (to[:, 0] * self.ways[:, 1] - to[:, 1] * self.ways[:, 0]) / np.hypot(*to.T)
        return np.asarray(np.abs(np.arcsin(np.clip(sines, -1, 1))))


def _straight(paths: Sequence[Float64Array], middle: Float64Array) -> _Lines:
    rows = []
    for path in paths:
        if len(path) < 3:
            continue
        center = path.mean(axis=0)
        _, (length, width), ways = np.linalg.svd(path - center, full_matrices=False)
        if width <= _STRAIGHT * length:
            rows.append((*(center - middle), *ways[0], length))
    if len(rows) < _LEAST:
        raise ConfigError(f"{len(rows)} vehicles drive straight on; take a longer clip")
    table = np.array(rows, np.float64)
    return _Lines(table[:, :2], table[:, 2:4], table[:, 4])


def _vanishing_point(lines: _Lines) -> tuple[Float64Array, BoolArray]:
    """Return the homogeneous point at which most lines meet, and which lines these are."""
    order = np.argsort(-lines.lengths)
    ones = np.ones((len(order), 1))
    flat = np.cross(np.hstack([lines.middles, ones]), np.hstack([lines.ways, 0 * ones]))
    best, most = np.zeros(len(order), np.bool_), 0.0
    for a, b in islice(combinations(order.tolist(), 2), _TRIED):
        point = np.cross(flat[a], flat[b])
        if not point.any():
            continue
        fits = lines.angles(point) <= _OFF
        if (total := float(lines.lengths[fits].sum())) > most and fits.sum() >= _LEAST:
            best, most = fits, total
    if not most:
        raise ConfigError("no three vehicles drive the same way; take a longer clip")
    # Nearly parallel paths say little about where they meet, so all are used at once.
    scaled = flat[best] * lines.lengths[best, None] / (1, 1, np.abs(flat[best, 2]).max() or 1)
    point = np.linalg.svd(scaled)[2][-1] / (1, 1, np.abs(flat[best, 2]).max() or 1)
    return np.asarray(point, np.float64), best


def _second(
    lines: _Lines, first: Float64Array, fits: BoolArray, width: int
) -> tuple[Float64Array, float]:
    """Return the vanishing point of a stream across the first one, and the focal length."""
    rest = lines.only(~fits & (lines.angles(first) >= _OTHER))
    hint = "give four points with metres, or --camera"
    try:
        second, _ = _vanishing_point(rest)
    except ConfigError as error:
        raise ConfigError(f"only one stream of vehicles drives straight on; {hint}") from error
    square = -(first[0] * second[0] + first[1] * second[1]) / (first[2] * second[2] or math.inf)
    if not (_FOCAL[0] * width) ** 2 <= square <= (_FOCAL[1] * width) ** 2:
        raise ConfigError(f"the two streams do not cross at a right angle; {hint}")
    return second, math.sqrt(square)

"""A car as a solid of flat facets, to be seen from behind.

Coordinates of a car are metres: x to the right of its middle, y up from the ground, z ahead of
its rear. The lower body is a prism, the cabin a frustum on top of it; lights, plate, windows and
wheels are facets painted on them.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from vdet.synthetic.camera import Points
from vdet.synthetic.painting import mixed, shaded
from vdet.synthetic.scene import Body, Color

_GLASS: Color = (62, 52, 46)
_TYRE: Color = (26, 25, 25)
_RIM: Color = (150, 148, 146)
_UNDERSIDE: Color = (20, 19, 19)
_LIGHT: Color = (38, 26, 165)
_PLATE: Color = (205, 208, 208)

_SILL = 0.26  # height of the lower edge of the body
_REAR_AXLE = 0.85
_WHEEL = 0.31  # radius


@dataclass(frozen=True, slots=True)
class Facet:
    """A flat polygon `(n, 3)` of a car, its corners clockwise as seen from outside."""

    corners: Points
    color: Color


@lru_cache(maxsize=64)
def facets(body: Body, color: Color) -> tuple[Facet, ...]:
    """Return the facets of a car, in the order in which they are to be painted."""
    return (
        *_underside(body),
        *_lower_body(body, color),
        *_wheels(body, color),
        *_rear(body, color),
        *_cabin(body, color),
    )


def footprint(body: Body, sun: float) -> Points:
    """Return the outline of a car's shadow on the ground; without `sun` it stays below the car."""
    left, right = min(0.0, sun) - body.width / 2, max(0.0, sun) + body.width / 2
    rear, front = _REAR_AXLE - _WHEEL, body.length
    return _quad((left, 0, rear), (right, 0, rear), (right, 0, front), (left, 0, front))


def _underside(body: Body) -> list[Facet]:
    half = body.width / 2
    tyre = 0.24
    rear = _REAR_AXLE - _WHEEL
    tyres = [
        Facet(_upright(left, left + tyre, 0.0, _SILL + 0.05, rear), _TYRE)
        for left in (-half + 0.04, half - 0.04 - tyre)
    ]
    below = _upright(-half + 0.1, half - 0.1, 0.1, _SILL + 0.05, rear)
    return [Facet(below, _UNDERSIDE), *tyres]


def _lower_body(body: Body, color: Color) -> list[Facet]:
    """Extrude the outline of the rear along the car."""
    half, belt = body.width / 2, body.belt
    outline = [
        (-half + 0.06, _SILL),
        (-half, _SILL + 0.14),
        (-half, belt - 0.2),
        (-half + 0.1, belt),
        (half - 0.1, belt),
        (half, belt - 0.2),
        (half, _SILL + 0.14),
        (half - 0.06, _SILL),
    ]
    parts = []
    for (x0, y0), (x1, y1) in pairwise(outline):
        corners = [[x0, y0, 0], [x0, y0, body.length], [x1, y1, body.length], [x1, y1, 0]]
        upward = (x1 - x0) / np.hypot(x1 - x0, y1 - y0)
        parts.append(Facet(np.array(corners, dtype=float), shaded(color, 0.78 + 0.3 * upward)))
    parts.append(Facet(np.array([[x, y, 0.0] for x, y in outline]), shaded(color, 0.92)))
    return parts


def _wheels(body: Body, color: Color) -> list[Facet]:
    """Paint arches, tyres, rims and the doors' lower edge onto both sides."""
    parts = []
    for side in (-1, 1):
        x = side * (body.width / 2 + 0.005)
        for axle in (_REAR_AXLE, body.length - 0.9):
            parts.append(Facet(_disc(x, axle, _WHEEL + 0.06), shaded(color, 0.3)))
            parts.append(Facet(_disc(x, axle, _WHEEL), _TYRE))
            parts.append(Facet(_disc(x, axle, 0.62 * _WHEEL), _RIM))
    return parts


def _rear(body: Body, color: Color) -> list[Facet]:
    """Paint bumper, boot, plate and lights onto the rear."""
    half, belt = body.width / 2, body.belt
    bumper = _SILL + 0.32
    parts = [
        Facet(_upright(-half + 0.05, half - 0.05, _SILL, _SILL + 0.1, -0.01), shaded(color, 0.4)),
        Facet(_upright(-half, half, bumper, bumper + 0.03, -0.01), shaded(color, 0.5)),
        Facet(_upright(-half + 0.1, half - 0.1, belt - 0.05, belt, -0.01), shaded(color, 1.12)),
        Facet(_upright(-0.27, 0.27, bumper + 0.05, bumper + 0.17, -0.02), _PLATE),
    ]
    for left in (-half + 0.02, half - 0.36):
        box = (left, left + 0.34, belt - 0.24, belt - 0.06)
        parts.append(Facet(_upright(*box, -0.02), mixed(_LIGHT, shaded(color, 0.5), 0.2)))
    return parts


def _cabin(body: Body, color: Color) -> list[Facet]:
    """Put a frustum with windows onto the lower body."""
    low, high = body.width / 2 - 0.12, body.width / 2 - 0.3
    belt, roof = body.belt, body.height
    rear_low, rear_high = body.boot, body.boot + body.slope
    front_low = max(rear_high + 1.2, body.length - 1.3)
    front_high = max(rear_high + 0.8, front_low - 0.8)
    rear = _quad(
        (-low, belt, rear_low),
        (-high, roof, rear_high),
        (high, roof, rear_high),
        (low, belt, rear_low),
    )
    left = _quad(
        (-low, belt, front_low),
        (-high, roof, front_high),
        (-high, roof, rear_high),
        (-low, belt, rear_low),
    )
    right = _quad(
        (low, belt, rear_low),
        (high, roof, rear_high),
        (high, roof, front_high),
        (low, belt, front_low),
    )
    top = _quad(
        (-high, roof, rear_high),
        (-high, roof, front_high),
        (high, roof, front_high),
        (high, roof, rear_high),
    )
    parts = [Facet(top, shaded(color, 1.1))]
    for side in (left, right):
        parts.append(Facet(side, shaded(color, 0.85)))
        parts.append(Facet(_inset(side, 0.08, 0.47), shaded(_GLASS, 0.8)))
        parts.append(Facet(_inset(side, 0.53, 0.92), shaded(_GLASS, 0.8)))
    parts.append(Facet(rear, shaded(color, 0.95)))
    parts.append(Facet(_inset(rear, 0.1, 0.9), _GLASS))
    return parts


def _quad(*corners: tuple[float, float, float]) -> Points:
    return np.array(corners)


def _upright(left: float, right: float, bottom: float, top: float, z: float) -> Points:
    return _quad((left, bottom, z), (left, top, z), (right, top, z), (right, bottom, z))


def _disc(x: float, axle: float, radius: float) -> Points:
    """Return a wheel's circle on the side at `x`, clockwise as seen from that side."""
    angles = np.linspace(0, 2 * np.pi, 16, endpoint=False) * np.sign(x)
    y, z = _WHEEL + radius * np.sin(angles), axle + radius * np.cos(angles)
    return np.stack([np.full(16, x), np.maximum(y, 0.0), z], axis=1)[::-1]


def _inset(quad: Points, left: float, right: float) -> Points:
    """Return the part of a quad between two shares of its width, 14 % off its lower and upper edge.

    The corners of a quad are lower left, upper left, upper right, lower right.
    """
    lower_left, upper_left, upper_right, lower_right = quad

    def at(across: float, up: float) -> Points:
        lower = lower_left + across * (lower_right - lower_left)
        upper = upper_left + across * (upper_right - upper_left)
        return np.asarray(lower + up * (upper - lower))

    return np.array([at(left, 0.14), at(left, 0.86), at(right, 0.86), at(right, 0.14)])

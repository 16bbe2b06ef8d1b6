"""Draws a vehicle as a solid of flat facets.

Its coordinates are metres: x to the right of its middle, y up from the ground, z ahead of its rear.
The lower body is a prism, the cabin a frustum on top of it. Lights, plate, windows and wheels are
facets painted on them.
"""

from functools import lru_cache
from itertools import pairwise

import cv2
import numpy as np

from vdet.boxes import Float64Array, Image
from vdet.draw.boxes import Color
from vdet.synthetic.camera import PinholeCamera, beyond_near, fill_outline, mixed, shaded
from vdet.synthetic.scene import Body, Scene, SceneVehicle, Waypoint

_SHADOW: Color = (34, 32, 32)
_GLASS: Color = (62, 52, 46)
_TYRE: Color = (26, 25, 25)
_RIM: Color = (150, 148, 146)
_UNDERSIDE: Color = (20, 19, 19)
_LIGHT: Color = (38, 26, 165)
_HEADLIGHT: Color = (215, 222, 222)
_PLATE: Color = (205, 208, 208)

_SILL = 0.26  # height of the lower edge of the body
_REAR_AXLE = 0.85
_WHEEL = 0.31  # radius
_HIGHEST_LIGHT = 1.15  # upper edge of the lights of a tall vehicle

STANDS = _REAR_AXLE - _WHEEL
"""Metres between its rear and the rear tyres, on which a vehicle is drawn to stand on the road."""


_Facet = tuple[Float64Array, Color]
"""A flat polygon `(n, 3)`, its corners clockwise as seen from outside, and its colour."""


def outlines(
    vehicle: SceneVehicle, position: Waypoint, camera: PinholeCamera
) -> list[tuple[Float64Array, Color]]:
    """Return the pixels `(n, 2)` and colour of each visible facet, in painting order."""
    drawn = []
    for corners, color in _facets(vehicle.body, vehicle.color):
        outline = camera.project(beyond_near(_placed(corners, position)))
        if len(outline) and cv2.contourArea(outline.astype(np.float32), oriented=True) > 0:
            drawn.append((outline, color))
    return drawn


def draw_vehicle(image: Image, vehicle: SceneVehicle, position: Waypoint, scene: Scene) -> None:
    """Draw a vehicle and the shadow below it onto a frame."""
    half, sun = vehicle.body.width / 2, scene.light.sun
    front = vehicle.body.length - STANDS
    left, right = min(0.0, sun) - half, max(0.0, sun) + half
    shadow = _quad((left, 0, STANDS), (right, 0, STANDS), (right, 0, front), (left, 0, front))
    scene.camera.draw(image, _placed(shadow, position), _SHADOW)
    light = scene.brightness(scene.speed * position.time + position.ahead)
    for outline, color in outlines(vehicle, position, scene.camera):
        fill_outline(image, outline, shaded(color, light))


def _placed(corners: Float64Array, position: Waypoint) -> Float64Array:
    """Return corners `(n, 3)` of a vehicle in the coordinates of the camera."""
    sine, cosine = np.sin(position.heading), np.cos(position.heading)
    turn = np.array([[cosine, 0.0, -sine], [0.0, 1.0, 0.0], [sine, 0.0, cosine]])
    return np.asarray(corners @ turn + (position.lateral, 0.0, position.ahead))


@lru_cache(maxsize=512)
def _facets(body: Body, color: Color) -> list[_Facet]:
    """Return all facets in painting order. Of two that overlap, one is hidden."""
    facets = _underside(body) + _lower_body(body, color) + _wheels(body, color)
    return facets + _ends(body, color) + _cabin(body, color)


def _underside(body: Body) -> list[_Facet]:
    half, top = body.width / 2, _SILL + 0.05
    panels = [(-half + 0.1, half - 0.1, 0.1, _UNDERSIDE)]
    panels += [(x, x + 0.24, 0.0, _TYRE) for x in (-half + 0.04, half - 0.28)]
    return [
        (_upright(side * left, side * right, bottom, top, z), color)
        for side, z in ((-1, body.length - STANDS), (1, STANDS))  # seen from ahead, and from behind
        for left, right, bottom, color in panels
    ]


def _lower_body(body: Body, color: Color) -> list[_Facet]:
    """Extrude the outline of the rear along the vehicle."""
    half, belt = body.width / 2, body.belt
    left = [(-half + 0.06, _SILL), (-half, _SILL + 0.14), (-half, belt - 0.2), (-half + 0.1, belt)]
    outline = left + [(-x, y) for x, y in reversed(left)]
    parts = []
    for (x0, y0), (x1, y1) in pairwise(outline):
        corners = _quad((x0, y0, 0), (x0, y0, body.length), (x1, y1, body.length), (x1, y1, 0))
        upward = (x1 - x0) / np.hypot(x1 - x0, y1 - y0)
        parts.append((corners, shaded(color, 0.78 + 0.3 * upward)))
    rear, front = (_quad(*((x, y, z) for x, y in outline)) for z in (0.0, body.length))
    return [*parts, (rear, shaded(color, 0.92)), (front[::-1], shaded(color, 0.98))]


def _wheels(body: Body, color: Color) -> list[_Facet]:
    """Paint arches, tyres and rims onto both sides."""
    discs = (_WHEEL + 0.06, shaded(color, 0.3)), (_WHEEL, _TYRE), (0.62 * _WHEEL, _RIM)
    return [
        (_disc(side * (body.width / 2 + 0.005), axle, radius), painted)
        for side in (-1, 1)
        for axle in (_REAR_AXLE, body.length - 0.9)
        for radius, painted in discs
    ]


def _ends(body: Body, color: Color) -> list[_Facet]:
    """Paint bumper, boot or grille, plate and lights onto rear and front."""
    half, belt = body.width / 2, min(body.belt, _HIGHEST_LIGHT)
    rear, front, z = _SILL + 0.32, _SILL + 0.2, body.length + 0.01
    light = mixed(_LIGHT, shaded(color, 0.5), 0.2)
    panels = [
        (_upright(-half + 0.05, half - 0.05, _SILL, _SILL + 0.1, -0.01), shaded(color, 0.4)),
        (_upright(-half, half, rear, rear + 0.03, -0.01), shaded(color, 0.5)),
        (_upright(-half + 0.1, half - 0.1, belt - 0.05, belt, -0.01), shaded(color, 1.12)),
        (_upright(-0.27, 0.27, rear + 0.05, rear + 0.17, -0.02), _PLATE),
        (_upright(-half + 0.02, -half + 0.36, belt - 0.24, belt - 0.06, -0.02), light),
        (_upright(half - 0.36, half - 0.02, belt - 0.24, belt - 0.06, -0.02), light),
        (_upright(half - 0.05, -half + 0.05, _SILL, _SILL + 0.12, z), shaded(color, 0.4)),
        (_upright(half - 0.5, -half + 0.5, front, belt - 0.12, z), shaded(_GLASS, 0.6)),
        (_upright(0.26, -0.26, front, front + 0.12, z + 0.01), _PLATE),
        (_upright(half - 0.04, half - 0.44, belt - 0.28, belt - 0.1, z), _HEADLIGHT),
        (_upright(-half + 0.44, -half + 0.04, belt - 0.28, belt - 0.1, z), _HEADLIGHT),
    ]
    if body.belt > _HIGHEST_LIGHT:  # a windscreen
        panels.append((_upright(half - 0.15, -half + 0.15, 1.5, 2.5, z), _GLASS))
    return panels


def _cabin(body: Body, color: Color) -> list[_Facet]:
    """Put a frustum with windows onto the lower body."""
    low, high = body.width / 2 - 0.12, body.width / 2 - 0.3
    belt, roof = body.belt, body.height
    rear_low, rear_high = body.boot, body.boot + body.slope
    front_low = max(rear_high + 1.2, body.length - 1.3)
    front_high = max(rear_high + 0.8, front_low - 0.8)
    ends = rear_low, rear_high, front_high, front_low
    right = np.column_stack([(low, high, high, low), (belt, roof, roof, belt), ends])
    left = right * (-1, 1, 1)
    rear = np.array([left[0], left[1], right[1], right[0]])
    parts = [(np.array([left[1], left[2], right[2], right[1]]), shaded(color, 1.1))]
    for side in (left[::-1], right):
        windows = _inset(side, 0.08, 0.47), _inset(side, 0.53, 0.92)
        parts += [(side, shaded(color, 0.85)), *((glass, shaded(_GLASS, 0.8)) for glass in windows)]
    for end in (rear, np.array([right[3], right[2], left[2], left[3]])):
        parts += [(end, shaded(color, 0.95)), (_inset(end, 0.1, 0.9), _GLASS)]
    return parts


def _quad(*corners: tuple[float, float, float]) -> Float64Array:
    return np.array(corners, np.float64)


def _upright(left: float, right: float, bottom: float, top: float, z: float) -> Float64Array:
    return _quad((left, bottom, z), (left, top, z), (right, top, z), (right, bottom, z))


def _disc(x: float, axle: float, radius: float) -> Float64Array:
    """Return a wheel's circle on the side at `x`, clockwise as seen from that side."""
    angles = np.linspace(0, 2 * np.pi, 16, endpoint=False) * np.sign(x)
    y, z = _WHEEL + radius * np.sin(angles), axle + radius * np.cos(angles)
    return np.stack([np.full(16, x), np.maximum(y, 0.0), z], axis=1)[::-1]


def _inset(quad: Float64Array, left: float, right: float) -> Float64Array:
    """Return the part of a quad between two fractions of its width, less 14 % at bottom and top.

    The corners of a quad are lower left, upper left, upper right, lower right.
    """
    across, up = np.array([(left, 0.14), (left, 0.86), (right, 0.86), (right, 0.14)]).T[..., None]
    lower = quad[0] + across * (quad[3] - quad[0])
    upper = quad[1] + across * (quad[2] - quad[1])
    return np.asarray(lower + up * (upper - lower))

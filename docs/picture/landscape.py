"""The road, the land beside it, and the hills, seen along rays.

Rays leave the camera in the direction `(x, y, 1)`; `x` and `y` are float32 `(rows, columns)`. The
road bends, so `lateral` is metres to the right of its middle, and `z` is metres ahead.
"""

from dataclasses import dataclass

import numpy as np
from docs.picture.light import (
    GRAIN,
    ROUGH,
    SKYLIGHT,
    SMOOTH,
    SUN,
    SUNLIGHT,
    Noise,
    haze,
    mix,
    ramp,
    rgb,
    sky,
    unit,
)

from vdet.boxes import Float32Array
from vdet.synthetic.camera import PinholeCamera
from vdet.synthetic.random_scenes import LANE_WIDTH

CAMERA = PinholeCamera(1280, 720, 1152.0, 420.0, above_ground=1.24, curvature=1 / 1500)
"""The camera of the picture; it drives in the middle lane of three."""

LIGHT_ON_ROAD = 0.5 * SUN[1] * SUNLIGHT, 0.5 * SKYLIGHT
"""Of the sun and of the sky."""

_LEFT, _RIGHT = -1.5 * LANE_WIDTH, 1.5 * LANE_WIDTH
_PAVED = _LEFT - 1.0, _RIGHT + 2.6
_RAILS = _PAVED[0] - 0.25, _PAVED[1] + 0.45

_ASPHALT, _PAINT = rgb(114, 114, 114), rgb(236, 236, 230)
_GRAVEL, _GRASS, _DRY_GRASS = rgb(150, 142, 128), rgb(104, 118, 50), rgb(166, 154, 84)
_STEEL = rgb(196, 200, 204)


@dataclass(frozen=True)
class _Trees:
    """A row of trees along the road, `lateral` metres from its middle; negative to the left."""

    lateral: float
    height: float
    variation: float


_FOREST = rgb(70, 92, 40), rgb(104, 120, 52)
_BUSHES = rgb(96, 108, 46), rgb(140, 136, 66)
_ROWS = (
    _Trees(-62, 9.5, 2.6), _Trees(70, 10.0, 3.0), _Trees(44, 6.2, 2.6), _Trees(-38, 5.0, 2.4),
    _Trees(27, 2.6, 1.6), _Trees(-20, 1.3, 1.0), _Trees(17.5, 1.2, 0.9),
)  # fmt: skip


@dataclass(frozen=True)
class Canvas:
    """What rays see: colours `(rows, columns, 3)`, and distances `z`, infinite in the sky."""

    x: Float32Array
    y: Float32Array
    color: Float32Array
    depth: Float32Array


def landscape(x: Float32Array, y: Float32Array) -> Canvas:
    """Return what rays see where no vehicle is."""
    canvas = Canvas(x, y, np.zeros((*x.shape, 3), np.float32), np.full_like(x, np.inf))
    above = y > -1e-4
    canvas.color[above] = _with_hills(_sky(x[above], y[above]), x[above], y[above])
    z = CAMERA.above_ground / -y[~above]
    canvas.color[~above] = haze(_ground(x[~above], z), z)
    canvas.depth[~above] = z
    for number in range(1, len(_ROWS) + 1):
        _paint_trees(canvas, number)
    for lateral in _RAILS:
        _paint_rail(canvas, lateral)
    return canvas


def bend(z: Float32Array | float) -> Float32Array | float:
    """Return how far the road has gone to the right at a distance, metres."""
    return CAMERA.curvature * z * z / 2


def _sky(x: Float32Array, y: Float32Array) -> Float32Array:
    return sky(unit(np.stack([x, y, np.ones_like(x)], axis=-1)))


def _with_hills(color: Float32Array, x: Float32Array, y: Float32Array) -> Float32Array:
    for number, (height, variation, period, dark, bright) in enumerate(
        (
            (0.088, 0.026, 3.0, rgb(126, 150, 182), rgb(152, 172, 196)),
            (0.058, 0.020, 2.2, rgb(100, 126, 146), rgb(126, 148, 156)),
            (0.030, 0.012, 1.3, rgb(74, 98, 80), rgb(112, 130, 96)),
        )
    ):
        top = height + variation * SMOOTH(x, 1.4 + 0.12 * number, period)
        top += 0.07 * variation * ROUGH(x, 3.4 + 0.3 * number, period / 6)
        share = y / top
        relief = 0.5 * (ROUGH(3 * x, 6 * y, period) + SMOOTH(3 * x, 9 * y, period))
        slope = mix(dark, bright, ramp(-1.2, 1.6, relief + 0.8 * share - 0.4))
        slope = mix(slope, rgb(214, 214, 212), 0.8 * np.clip(0.45 - 0.3 * share, 0, 1))
        color = mix(color, slope, np.clip((top - y) * 2 * CAMERA.focal + 0.5, 0, 1))
    return color


def _ground(x: Float32Array, z: Float32Array) -> Float32Array:
    lateral = np.asarray(x * z - bend(z), np.float32)
    across, along = z / CAMERA.focal, z * z / (CAMERA.focal * CAMERA.above_ground)  # of a pixel

    def texture(noise: Noise, period: float, detail: float) -> Float32Array:
        """Return noise with details of that size, metres, without those smaller than a pixel."""
        return noise(lateral, z, period) * np.clip(detail / (1.5 * along), 0, 1)

    def cover(inside: Float32Array) -> Float32Array:
        """Return the share of a pixel that lies in an area; `inside` is metres from its border."""
        return np.clip(inside / across + 0.5, 0, 1)

    tone = 1 + 0.05 * texture(SMOOTH, 40, 3) + 0.05 * texture(ROUGH, 9, 2)
    tone += 0.10 * texture(GRAIN, 10, 0.04) + 0.05 * texture(GRAIN, 3.1, 0.02)
    in_lane = (lateral - _LEFT) % LANE_WIDTH - LANE_WIDTH / 2
    wear = 0.10 * np.exp(-(((np.abs(in_lane) - 0.85) / 0.32) ** 2)) + 0.05 * np.exp(
        -((in_lane / 0.3) ** 2)
    )
    tone *= 1 - wear * ((lateral > _LEFT) & (lateral < _RIGHT))
    color = np.asarray(_ASPHALT * tone[..., None], np.float32)

    paint = np.zeros_like(z)
    for number in range(4):
        line = 0.1 - np.abs(lateral - _LEFT - number * LANE_WIDTH)
        phase = (z + (0, 9, 2, 0)[number]) % 18
        dash = np.minimum(phase, 6 - phase) if number in (1, 2) else np.inf
        dashes = np.clip(dash / np.maximum(along, 0.02) + 0.5, 0, 1)
        paint += cover(line) * np.minimum(1, 0.2 / across) * dashes
    worn = 0.93 * np.clip(1 - 0.1 * np.abs(texture(GRAIN, 6, 0.05)), 0.5, 1)
    color = mix(color, _PAINT, paint * worn)

    beside = np.maximum(_PAVED[0] - lateral, lateral - _PAVED[1])
    color = mix(color, _GRAVEL * (1 + 0.14 * texture(GRAIN, 12, 0.05))[..., None], cover(beside))
    dry = ramp(-1.2, 1.6, 0.5 * texture(SMOOTH, 26, 4) + 0.8 * texture(ROUGH, 7, 0.8))
    tone = 1 + 0.22 * texture(GRAIN, 14, 0.08) + 0.12 * texture(ROUGH, 3, 0.3)
    grass = mix(_GRASS, _DRY_GRASS, dry) * tone[..., None]
    edge = beside - 0.7 - 0.25 * ROUGH(0.5 * z, 0, 10)
    color = mix(color, grass, np.clip(edge / np.maximum(across, 0.15) + 0.5, 0, 1))
    for rail in _RAILS:
        shadow = 0.16 - np.abs(lateral - rail + 0.6 * SUN[0] / SUN[1])
        color = color * (1 - 0.38 * cover(shadow))[..., None]
    return np.asarray(color * sum(LIGHT_ON_ROAD), np.float32)


def _wall(x: Float32Array, lateral: float) -> Float32Array:
    """Return the distance `z` of a wall along the road, infinite for rays that miss it."""
    square = x * x - 2 * CAMERA.curvature * lateral
    root = np.sqrt(np.maximum(square, 0))
    z = (x - root if lateral > 0 else x + root) / CAMERA.curvature
    seen = (z > 0.3) & ((lateral < 0) | ((square > 0) & (x > 0)))
    return np.where(seen, z, np.inf).astype(np.float32)


def _paint_trees(canvas: Canvas, number: int) -> None:
    """Paint row `number` of the trees, from 1, as a wall with a ragged top and leaves of noise."""
    trees = _ROWS[number - 1]
    wall = _wall(canvas.x, trees.lateral)
    height = CAMERA.above_ground + canvas.y * np.minimum(wall, 1e4)
    size, variation = trees.height, trees.variation
    place = np.nonzero(
        (wall > 14)
        & (wall < 600)
        & (wall < canvas.depth)
        & (height > 0)
        & (height < 2 * size + variation)
    )
    z, up = wall[place], height[place]
    # Along the logarithm of the distance, trees are as wide as they are high at any distance.
    along = abs(trees.lateral) * np.log(z) + 37.7 * number
    top = size + variation * 0.55 * SMOOTH(along, number, 14 * size)
    top += variation * 0.30 * SMOOTH(along, 0.7 * number, 4 * size)
    ragged = 0.07 * size * SMOOTH(along, up, size) + 0.035 * size * ROUGH(along, up, 0.7 * size)
    leaves = 0.7 * (SMOOTH(along, up, 1.3 * size) + ROUGH(along, up, 0.9 * size))
    leaves += 0.35 * GRAIN(along, up, 4 * size)
    share = np.clip(up / np.maximum(top, 0.5), 0, 1)
    light = np.clip(0.66 + 0.27 * leaves + 0.3 * share - 0.45 * ramp(-0.35, 0, -share), 0.1, 1.7)
    dark, bright = _FOREST if size > 2 else _BUSHES
    tree = mix(dark, bright, ramp(-1.4, 1.4, SMOOTH(along, 0.3 * up, 5 * size)))
    tree = haze(tree * light[..., None] * np.array([0.93, 0.87, 0.68], np.float32), z)
    seen = up < top + ragged
    place = tuple(index[seen] for index in place)
    canvas.color[place], canvas.depth[place] = tree[seen], z[seen]


def _paint_rail(canvas: Canvas, lateral: float) -> None:
    """Paint a guard rail: posts every 4 m, before them a beam with two ridges."""
    wall = _wall(canvas.x, lateral)
    height = CAMERA.above_ground + canvas.y * np.minimum(wall, 1e4)
    place = np.nonzero((wall < 400) & (wall < canvas.depth) & (height > 0) & (height < 1))
    z, up = wall[place], height[place]
    across, along = z / CAMERA.focal, z * z / CAMERA.focal / abs(lateral)  # of a pixel
    from_post = np.abs((z + 1) % 4 - 2)
    post = np.clip((0.07 - from_post) / along + 0.5, 0, 1) * np.clip(0.14 / along, 0, 1)
    seen = mix(canvas.color[place], haze(0.4 * _STEEL, z), (up < 0.6) * post)
    angle = (up - 0.44) / 0.32 * 4 * np.pi
    light = 0.63 + 0.23 * np.cos(angle) + 0.17 * np.sin(angle)
    light *= 1 - 0.35 * (np.abs(z % 4 - 2) < 0.05) * np.clip(25 / z, 0, 1)
    beam = np.clip((0.16 - np.abs(up - 0.6)) / across + 0.5, 0, 1)
    canvas.color[place] = mix(seen, haze(_STEEL * light[..., None], z), beam)

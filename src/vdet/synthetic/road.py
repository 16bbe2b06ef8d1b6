"""The road: asphalt, verge and lane lines, and what stands beside it.

The colours of the ground and the solid lines are the same in all frames; dashes and texture move.
"""

from collections.abc import Iterator

import cv2
import numpy as np

from vdet.boxes import Float32Array, Float64Array
from vdet.draw.paint import Color
from vdet.media.images import Image
from vdet.synthetic.camera import NEAR, PinholeCamera, distances, mixed, shaded
from vdet.synthetic.scene import PERIOD, Carriageway, Line, RoadsideObject, Scene, Wall

_TEXEL = 0.1  # metres a pixel of the finest texture
_HALF_WIDTH = 30.0  # metres of texture to either side of the camera
_NEUTRAL = 128  # texture value that does not change the colour
_FAR = 100.0  # metres; dashes end here
_NEAREST, _FARTHEST = 3.0, 140.0  # metres; objects nearer or farther are not drawn
_SPRITE = 96  # side of an image of foliage, pixels
_SPRITES = 6

_Part = tuple[float, float, float, float]
"""Left, right, bottom and top of a part of an object, 0 to 1."""

_WHOLE: _Part = (0.0, 1.0, 0.0, 1.0)
_BOX: tuple[tuple[_Part, float], ...] = (
    (_WHOLE, 1.0),
    ((0.0, 1.0, 0.9, 1.0), 1.3),
    ((0.15, 0.85, 0.55, 0.75), 0.35),
)
"""The front of a box, its lid and a dark slot, with the brightness of their colour."""


class Ground:
    """Draws the part of a scene below the horizon."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        camera = scene.camera
        self._top = int(camera.horizon) + 2
        rows = np.arange(self._top, camera.height, dtype=np.float32)
        self._distance = camera.focal * camera.above_ground / (rows - np.float32(camera.horizon))
        columns = np.arange(camera.width, dtype=np.float32) - camera.width / 2
        distance = self._distance[:, None]
        bend = camera.curvature * distance**2 / 2
        self._lateral = (columns[None, :] * distance / camera.focal - bend).astype(np.float32)
        self._texture = _pyramid(_texture(scene))
        self._maps = list(self._levels())

    def paint_base(self, image: Image) -> None:
        """Paint what is the same in all frames: colours of road and verge, solid lines."""
        pixel = self._distance[:, None] / self._scene.camera.focal
        image[self._top :] = _colors(self._scene.road, self._lateral, pixel)
        for line in self._scene.road.lines:
            if line.dash is None:
                _draw_stripe(image, self._scene, line, NEAR, 6 * _FAR)

    def draw(self, image: Image, station: float) -> None:
        """Draw dashes and texture over the base, as seen from a station of the camera."""
        for line in self._scene.road.lines:
            for start, end in _dashes(line, station):
                _draw_stripe(image, self._scene, line, start, end)
        ground = image[self._top :]
        gain = self._gain(station % PERIOD)
        cv2.multiply(ground, cv2.merge([gain, gain, gain]), dst=ground, scale=1 / _NEUTRAL)

    def _gain(self, station: float) -> Image:
        """Return the texture projected to the image, uint8 `(rows below the horizon, W)`."""
        parts = []
        for level, x, y in self._maps:
            texture, rows = self._texture[level], y + np.float32(station / _texel(level))
            parts.append(cv2.remap(texture, x, rows, cv2.INTER_LINEAR, None, cv2.BORDER_WRAP))
        return np.asarray(np.concatenate(parts), dtype=np.uint8)

    def _levels(self) -> Iterator[tuple[int, Float32Array, Float32Array]]:
        """Yield each texture level with the columns and rows in it of image rows at station 0.

        A run of image rows has the level at which no row skips texels.
        """
        step = self._distance**2 / (self._scene.camera.focal * self._scene.camera.above_ground)
        coarse, fine = np.searchsorted(-step, [-16 * _TEXEL, -4 * _TEXEL]).tolist()
        for level, start, end in ((2, 0, coarse), (1, coarse, fine), (0, fine, len(step))):
            if start < end:
                x = (self._lateral[start:end] + np.float32(_HALF_WIDTH)) / _texel(level)
                y = np.repeat(self._distance[start:end, None] / _texel(level), x.shape[1], axis=1)
                yield level, x, y


def _texel(level: int) -> np.float32:
    """Return the metres of ground that a pixel of a level of the texture covers."""
    return np.float32(_TEXEL * 4**level)


def _texture(scene: Scene) -> Image:
    """Return the brightness of the ground, uint8, 128 is neutral; `PERIOD` × 60 m at 10 cm a pixel.

    Rows are stations, columns run from 30 m left to 30 m right of the camera.
    """
    rng = np.random.default_rng([scene.seed, 1])
    rows, columns = int(PERIOD / _TEXEL), int(2 * _HALF_WIDTH / _TEXEL)
    grain = _noise(rng, rows, columns, 1)
    patches = _noise(rng, rows, columns, 12)
    tracks = cv2.resize(_noise(rng, 1, columns, 6), (columns, rows))
    lateral = np.linspace(-_HALF_WIDTH, _HALF_WIDTH, columns)
    paved = (lateral > scene.road.left) & (lateral < scene.road.right)
    gain = 1 + np.where(paved, 0.04, 0.12) * grain + np.where(paved, 0.04, 0.14) * patches
    gain += np.where(paved, 0.03, 0.0) * tracks
    for shadow in scene.light.shadows:
        start, end = (int(s / _TEXEL) for s in (shadow.station, shadow.station + shadow.length))
        dark = patches[start:end] > 0 if shadow.dappled else np.True_
        gain[start:end] *= np.where(dark, 1 - shadow.strength, 1.0)
    return np.clip(gain * _NEUTRAL, 0, 255).astype(np.uint8)


def _noise(rng: np.random.Generator, rows: int, columns: int, grain: int) -> Float32Array:
    """Return smooth noise, mean 0 and deviation about 1, `(rows, columns)`."""
    shape = (max(1, rows // grain), max(1, columns // grain))
    noise = rng.standard_normal(shape, dtype=np.float32)
    return np.asarray(cv2.resize(noise, (columns, rows), interpolation=cv2.INTER_CUBIC))


def _pyramid(finest: Image) -> list[Image]:
    """Return the texture at 1, 4 and 16 times the texel size."""
    levels = [finest]
    for _ in range(2):
        rows, columns = levels[-1].shape
        smaller = cv2.resize(levels[-1], (columns // 4, rows // 4), interpolation=cv2.INTER_AREA)
        levels.append(np.asarray(smaller, dtype=np.uint8))
    return levels


def _colors(road: Carriageway, lateral: Float32Array, pixel: Float32Array) -> Float32Array:
    """Return the colour at each lateral position; `pixel` is a pixel's width in metres."""
    inside = np.minimum(lateral - road.left, road.right - lateral) / pixel + 0.5
    paved = np.clip(inside, 0, 1)[..., None]
    asphalt, verge = (np.array(color, np.float32) for color in (road.asphalt, road.verge))
    return np.asarray(paved * asphalt + (1 - paved) * verge, np.float32)


def _dashes(line: Line, station: float) -> Iterator[tuple[float, float]]:
    """Give the visible dashes as `(start, end)`, metres ahead; none for a solid line."""
    if line.dash is None:
        return
    period = line.dash + line.gap
    for start in np.arange(-(station % period), _FAR, period):
        if start + line.dash > NEAR:
            yield max(NEAR, float(start)), float(start) + line.dash


def _draw_stripe(image: Image, scene: Scene, line: Line, start: float, end: float) -> None:
    """Draw a lane line from `start` to `end`, metres ahead."""
    z = distances(start, end)
    x = line.lateral + np.repeat([-0.5, 0.5], len(z)) * line.width
    z = np.concatenate([z, z[::-1]])
    stripe = np.stack([x, np.zeros_like(z), z], axis=1)
    scene.camera.draw(image, stripe, mixed(scene.road.asphalt, line.color, line.strength))


class Roadside:
    """Draws the roadside of one scene."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        rng = np.random.default_rng([scene.seed, 2])
        self._foliage = [_foliage(rng) for _ in range(_SPRITES)]

    def draw(self, image: Image, station: float) -> None:
        """Draw objects and walls as seen from a station of the camera."""
        camera = self._scene.camera
        placed = [((item.station - station) % PERIOD, item) for item in self._scene.roadside]
        for ahead, item in sorted(placed, key=lambda pair: -pair[0]):
            if not _NEAREST < ahead < _FARTHEST:
                continue
            if item.kind == "box":
                for part, factor in _BOX:
                    camera.draw(image, _panel(item, ahead, part), shaded(item.color, factor))
            else:
                sprite = self._foliage[int(item.station * 10) % _SPRITES]
                corners = camera.project(_panel(item, ahead, _WHOLE))
                _draw_foliage(image, corners, item.color, sprite)
        for wall in self._scene.road.walls:
            _draw_wall(image, camera, wall, station)


def _draw_wall(image: Image, camera: PinholeCamera, wall: Wall, station: float) -> None:
    z = distances(NEAR, 4 * _FARTHEST)
    dark, bright = shaded(wall.color, 0.7), shaded(wall.color, 1.35)
    camera.draw(image, _strip(wall, z, wall.bottom, wall.top), wall.color)
    camera.draw(image, _strip(wall, z, wall.top - 0.08, wall.top), bright)
    for start in np.arange(wall.spacing - station % wall.spacing, 60.0, wall.spacing):
        joint = np.array([start, start + 0.12])
        camera.draw(image, _strip(wall, joint, 0.0, wall.top - 0.1), dark)


def _strip(wall: Wall, z: Float64Array, bottom: float, top: float) -> Float64Array:
    """Return the outline of a strip of a wall between two heights, along the distances `z`."""
    y = np.repeat([bottom, top], len(z))
    return np.stack([np.full_like(y, wall.lateral), y, np.concatenate([z, z[::-1]])], axis=1)


def _panel(item: RoadsideObject, ahead: float, part: _Part) -> Float64Array:
    """Return a part of an object as a rectangle facing the camera."""
    left, right, bottom, top = part
    x0, x1 = (item.lateral + (share - 0.5) * item.width for share in (left, right))
    y0, y1 = bottom * item.height, top * item.height
    return np.array([[x0, y0, ahead], [x0, y1, ahead], [x1, y1, ahead], [x1, y0, ahead]])


def _foliage(rng: np.random.Generator) -> tuple[Image, Image]:
    """Return an image of foliage in grey, `(96, 96)`, and its mask."""
    coarse = cv2.resize(rng.standard_normal((8, 8)), (_SPRITE, _SPRITE))
    fine = cv2.resize(rng.standard_normal((32, 32)), (_SPRITE, _SPRITE))
    y, x = np.mgrid[-1 : 1 : _SPRITE * 1j, -1 : 1 : _SPRITE * 1j]
    inside = 0.75 - (np.abs(x) ** 2.5 + np.abs(y) ** 2.5) + 0.18 * coarse + 0.16 * fine
    lit = 96 + 30 * coarse + 24 * fine - 40 * y
    grey = np.clip(lit, 10, 255).astype(np.uint8)
    return grey, np.where(inside > 0, 255, 0).astype(np.uint8)


def _draw_foliage(
    image: Image, corners: Float64Array, color: Color, sprite: tuple[Image, Image]
) -> None:
    """Draw the part of a tree or a bush that lies in the frame."""
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    left, top = max(0, int(x0)), max(0, int(y0))
    right, bottom = min(image.shape[1], int(x1) + 1), min(image.shape[0], int(y1) + 1)
    if right <= left or bottom <= top or x1 - x0 < 2:
        return
    scale_x, scale_y = _SPRITE / (x1 - x0), _SPRITE / (y1 - y0)
    shrink = np.array([[scale_x, 0, (left - x0) * scale_x], [0, scale_y, (top - y0) * scale_y]])
    size = (right - left, bottom - top)
    grey, mask = (
        cv2.warpAffine(part, shrink, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
        for part in sprite
    )
    colored = cv2.merge([cv2.convertScaleAbs(grey, alpha=value / 128) for value in color])
    image[top:bottom, left:right][mask > 127] = colored[mask > 127]

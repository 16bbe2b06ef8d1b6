"""The ground: asphalt, verge and lane lines.

The colours and the solid lines are the same in all frames; dashes and texture move.
"""

from collections.abc import Iterator

import cv2
import numpy as np

from vdet.boxes import Float32Array
from vdet.media.images import Image
from vdet.synthetic.camera import NEAR, distances, mixed
from vdet.synthetic.scene import PERIOD, Carriageway, Line, Scene

_TEXEL = 0.1  # metres a pixel of the finest texture
_HALF_WIDTH = 30.0  # metres of texture to either side of the camera
_NEUTRAL = 128  # texture value that does not change the colour
_FAR = 100.0  # metres; dashes end here


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

"""Renders scenes as frames and as video files.

Sky, ground colours and solid lines are painted once per scene; dashes, ground texture, plants and
vehicles are drawn in each frame.
"""

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Float32Array, Float64Array, Image
from vdet.config.schema import OutputSettings
from vdet.files import staged
from vdet.media import Frame, Picture, VideoInfo
from vdet.media.writer import VideoWriter
from vdet.synthetic.camera import NEAR, shaded
from vdet.synthetic.scene import LINE_WIDTH, PERIOD, LaneLine, Scene
from vdet.synthetic.vehicle import draw_vehicle

_CRF = 20  # of the video; it is material to be searched, so it is finer than what is shown
_SHIFT = 61  # pixels by which the noise image is larger than a frame
_TEXEL = 0.1  # metres a pixel of the finest texture
_HALF_WIDTH = 30.0  # metres of texture to either side of the camera
_NEUTRAL = 128  # texture value that does not change the colour
_DASHES = 12.0  # metres from the start of a dash to the start of the next one
_FAR = 100.0  # metres; dashes end here
_NEAREST, _FARTHEST = 3.0, 140.0  # metres; plants nearer or farther are not drawn
_CROWN = ((1.0, 0.85), (0.7, 0.95))
"""Size and brightness of the parts of a plant. With more contrast it would look like a vehicle."""

_Level = tuple[Image, float, Float32Array, Float32Array]
"""A texture, the metres of ground that a pixel of it covers, and the columns and rows in it of
image rows at station 0."""


class Renderer:
    """Draws the frames of one scene; sky and static parts of the ground are painted once."""

    def __init__(self, scene: Scene) -> None:
        camera, road = scene.camera, scene.road
        self._scene = scene
        self._noise = _sensor_noise(scene)
        self._top = int(camera.horizon) + 2
        """The first row of the ground."""
        rows = np.arange(self._top, camera.height, dtype=np.float32)[:, None]
        distance = camera.focal * camera.above_ground / (rows - np.float32(camera.horizon))
        columns = np.arange(camera.width, dtype=np.float32) - camera.width / 2
        bend = camera.curvature * distance**2 / 2
        lateral = (columns * distance / camera.focal - bend).astype(np.float32)
        self._levels = _levels(scene, lateral, distance)
        inside = np.minimum(lateral - road.left, road.right - lateral)
        paved = np.clip(inside / (distance / camera.focal) + 0.5, 0, 1)[..., None]
        asphalt, verge = (np.array(color, np.float32) for color in (road.asphalt, road.verge))
        ground = paved * asphalt + (1 - paved) * verge
        self._background = np.concatenate([_sky(scene)[: self._top], ground]).astype(np.uint8)
        for line in road.lines:
            if line.dash is None:
                _draw_stripe(self._background, scene, line, NEAR, 6 * _FAR)

    def image(self, index: int) -> Image:
        """Return frame `index`, BGR uint8 `(H, W, 3)`."""
        scene = self._scene
        image = self._background.copy()
        self._draw_ground(image, scene.station(index))
        _draw_plants(image, scene, scene.station(index))
        for position, vehicle in reversed(scene.nearest_first(scene.time(index))):
            draw_vehicle(image, vehicle, position, scene)
        return self._expose(image, index)

    def _draw_ground(self, image: Image, station: float) -> None:
        """Draw dashes and texture over the base, as seen from a station of the camera."""
        for line in self._scene.road.lines:
            if line.dash is not None:
                for start in np.arange(-(station % _DASHES), _FAR, _DASHES).tolist():
                    if (end := start + line.dash) > NEAR:
                        _draw_stripe(image, self._scene, line, max(NEAR, start), end)
        parts = []
        for texture, texel, x, y in self._levels:
            rows = y + np.float32(station % PERIOD / texel)
            parts.append(cv2.remap(texture, x, rows, cv2.INTER_LINEAR, None, cv2.BORDER_WRAP))
        gain, ground = np.concatenate(parts), image[self._top :]
        cv2.multiply(ground, cv2.merge([gain, gain, gain]), dst=ground, scale=1 / _NEUTRAL)

    def _expose(self, image: Image, index: int) -> Image:
        """Return the image with lens blur, exposure and sensor noise."""
        soft = cv2.GaussianBlur(image, (3, 3), 0.6)
        exposed = cv2.convertScaleAbs(soft, alpha=self._scene.light.gain)
        x, y = np.random.default_rng([self._scene.seed, 4, index]).integers(0, _SHIFT, 2)
        height, width = image.shape[:2]
        noise = self._noise[y : y + height, x : x + width]
        return np.asarray(cv2.add(exposed, noise, dtype=cv2.CV_8U), dtype=np.uint8)


def frames(scene: Scene) -> Iterator[Frame]:
    """Render the frames of a scene, the first at 0 s."""
    renderer = Renderer(scene)
    for index in range(scene.frames):
        yield Frame(index, Fraction(index) / scene.rate, Picture(renderer.image(index)))


def write_clip(path: Path, scene: Scene, *, overwrite: bool = False) -> None:
    """Write a scene as an H.264 video without audio.

    Raises
    ------
    OutputError
        The file cannot be written, or its suffix is not that of a video.
    """
    camera, rate = scene.camera, scene.rate
    info = VideoInfo(path, camera.width, camera.height, rate, 1 / rate, frames=scene.frames)
    with (
        staged(path, overwrite=overwrite) as temporary,
        VideoWriter(temporary, info, OutputSettings(crf=_CRF), name=path) as writer,
    ):
        for frame in frames(scene):
            writer.write(frame)


def _sensor_noise(scene: Scene) -> npt.NDArray[np.int16]:
    """Return an image of noise, larger than a frame; each frame uses another part of it."""
    rng = np.random.default_rng([scene.seed, 5])
    shape = (scene.camera.height + _SHIFT, scene.camera.width + _SHIFT, 3)
    noise = rng.standard_normal(shape, dtype=np.float32) * np.float32(scene.light.noise)
    return np.asarray(np.rint(noise), np.int16)


def _sky(scene: Scene) -> Float64Array:
    """Return sky, clouds and hills down to the first rows of the ground, BGR `(rows, width, 3)`."""
    rng = np.random.default_rng([scene.seed, 3])
    horizon, width, unit = scene.camera.horizon, scene.camera.width, scene.camera.height / 720
    height = int(horizon) + 3

    def noise(rows: int, columns: int) -> Float64Array:
        return _enlarged(rng.standard_normal((rows, columns)), height, width)

    up = np.linspace(1, 0, height)[:, None, None]
    sky = up * np.array([168, 118, 78]) + (1 - up) * np.array([206, 186, 165])
    clouds = 0.25 * (noise(6, 10) + 0.4 * noise(18, 40) - rng.uniform(-0.5, 1.5))
    clouds = np.clip(clouds, 0, 0.7)[..., None]
    sky = (1 - clouds) * sky + clouds * 225
    for high, rough, color in ((88, 30, (94, 80, 66)), (34, 26, (44, 62, 60))):
        skyline = horizon - unit * (high + rough * (0.5 * noise(1, 8) + 0.22 * noise(1, 90)))
        hills = np.clip(np.arange(height)[:, None] - skyline, 0, 1)[..., None]
        grain = 1 + 0.16 * noise(height // 4, width // 4)[..., None]
        sky = (1 - hills) * sky + hills * grain * color
    return np.asarray(np.clip(sky, 0, 255))


def _levels(scene: Scene, lateral: Float32Array, distance: Float32Array) -> list[_Level]:
    """Return the levels of the texture that rows of the image show, the farthest rows first.

    A row has the level at which it skips no texels; those of a level are four times as large as
    those of the level before. `lateral` `(rows, columns)` and `distance` `(rows, 1)` are where on
    the ground the pixels are, metres.
    """
    step = distance[:, 0] ** 2 / (scene.camera.focal * scene.camera.above_ground)  # metres a row
    texture, texel, end = _texture(scene), _TEXEL, len(step)
    levels: list[_Level] = []
    for finest in (4 * _TEXEL, 16 * _TEXEL, np.inf):
        start = int(np.searchsorted(-step, -finest))
        if start < end:
            x = (lateral[start:end] + _HALF_WIDTH) / texel
            y = np.repeat(distance[start:end] / texel, x.shape[1], axis=1)
            levels.insert(0, (texture, texel, x, y))
        size = texture.shape[1] // 4, texture.shape[0] // 4
        texture = np.asarray(cv2.resize(texture, size, interpolation=cv2.INTER_AREA), np.uint8)
        texel, end = 4 * texel, start
    return levels


def _texture(scene: Scene) -> Image:
    """Return the brightness of the ground, uint8, 128 is neutral; `PERIOD` × 60 m at 10 cm a pixel.

    Rows are stations, columns run from 30 m left to 30 m right of the camera.
    """
    rng = np.random.default_rng([scene.seed, 1])
    rows, columns = int(PERIOD / _TEXEL), int(2 * _HALF_WIDTH / _TEXEL)

    def noise(coarse_rows: int, coarse_columns: int, high: int = rows) -> Float32Array:
        coarse = rng.standard_normal((coarse_rows, coarse_columns), dtype=np.float32)
        return _enlarged(coarse, high, columns)

    grain, patches = noise(rows, columns), noise(rows // 12, columns // 12)
    tracks = noise(1, columns // 6, 1)
    lateral = np.linspace(-_HALF_WIDTH, _HALF_WIDTH, columns)
    paved = (lateral > scene.road.left) & (lateral < scene.road.right)
    gain = 1 + np.where(paved, 0.04, 0.12) * grain + np.where(paved, 0.04, 0.14) * patches
    gain += np.where(paved, 0.03, 0.0) * tracks
    for shadow in scene.light.shadows:
        start, end = (int(s / _TEXEL) for s in (shadow.station, shadow.station + shadow.length))
        dark = patches[start:end] > 0 if shadow.dappled else np.True_
        gain[start:end] *= np.where(dark, 1 - shadow.strength, 1.0)
    return np.clip(gain * _NEUTRAL, 0, 255).astype(np.uint8)


def _enlarged(noise: npt.NDArray[Any], rows: int, columns: int) -> npt.NDArray[Any]:
    """Return smooth noise `(rows, columns)`, mean 0 and deviation about 1."""
    return np.asarray(cv2.resize(noise, (columns, rows), interpolation=cv2.INTER_CUBIC))


def _draw_stripe(image: Image, scene: Scene, line: LaneLine, start: float, end: float) -> None:
    """Draw a lane line from `start` to `end`, metres ahead.

    Its corners are 5 % apart, which is enough to follow any bend.
    """
    z = np.geomspace(start, end, 2 + int(20 * np.log(end / start)))
    x = line.lateral + np.repeat([-0.5, 0.5], len(z)) * LINE_WIDTH
    stripe = np.column_stack([x, np.zeros_like(x), np.concatenate([z, z[::-1]])])
    scene.camera.draw(image, stripe, line.color)


def _draw_plants(image: Image, scene: Scene, station: float) -> None:
    """Draw the plants beside the road as seen from a station of the camera."""
    placed = [((plant.station - station) % PERIOD, plant) for plant in scene.roadside]
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    for ahead, plant in sorted(placed, key=lambda pair: -pair[0]):
        if not _NEAREST < ahead < _FARTHEST:
            continue
        ragged = 1 + 0.12 * np.sin(7 * angles + plant.station) + 0.08 * np.sin(11 * angles)
        for size, brightness in _CROWN:
            x = plant.lateral + size * ragged * np.cos(angles) * plant.width / 2
            y = np.maximum(0, plant.height * (1 + size * ragged * np.sin(angles)) / 2)
            crown = np.column_stack([x, y, np.full_like(x, ahead)])
            scene.camera.draw(image, crown, shaded(plant.color, brightness))

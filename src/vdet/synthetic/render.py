"""Rendering: from scenes to frames, and to a video file."""

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from vdet.config.schema import OutputSettings
from vdet.draw.paint import Color
from vdet.files import staged
from vdet.media import Frame, Picture, VideoInfo, VideoWriter
from vdet.media.images import Image
from vdet.media.writer import may_replace_video
from vdet.synthetic.road import Ground, Roadside
from vdet.synthetic.scene import Scene
from vdet.synthetic.vehicle import draw_vehicle

_CRF = 20  # of the video; it is material to be searched, so it is finer than what is shown
_SHIFT = 61  # pixels by which the noise image is larger than a frame


class Renderer:
    """Draws the frames of one scene; sky and resting parts of the ground are painted once."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        camera = scene.camera
        self._ground = Ground(scene)
        self._roadside = Roadside(scene)
        self._background: Image = np.zeros((camera.height, camera.width, 3), np.uint8)
        _paint_sky(self._background, scene)
        self._ground.paint_base(self._background)
        self._noise = _sensor_noise(scene)

    def image(self, index: int) -> Image:
        """Return frame `index`, BGR uint8 `(H, W, 3)`."""
        station = self._scene.station(index)
        image = self._background.copy()
        self._ground.draw(image, station)
        self._roadside.draw(image, station)
        time = self._scene.time(index)
        for _, vehicle in reversed(self._scene.nearest_first(time)):
            draw_vehicle(image, vehicle, self._scene, time)
        return self._expose(image, index)

    def _expose(self, image: Image, index: int) -> Image:
        """Return the image with the blur of a lens, and the exposure and noise of a sensor."""
        light = self._scene.light
        soft = cv2.GaussianBlur(image, (3, 3), 0.6)
        exposed = cv2.convertScaleAbs(soft, alpha=light.gain)
        if not light.noise:
            return np.asarray(exposed, dtype=np.uint8)
        x, y = np.random.default_rng([self._scene.seed, 4, index]).integers(0, _SHIFT, 2)
        height, width = image.shape[:2]
        noise = self._noise[y : y + height, x : x + width]
        return np.asarray(cv2.add(exposed, noise, dtype=cv2.CV_8U), dtype=np.uint8)


def render(scene: Scene, index: int) -> Image:
    """Return one frame, BGR uint8 `(H, W, 3)`; use a `Renderer` for many frames of a scene."""
    return Renderer(scene).image(index)


def frames(scene: Scene) -> Iterator[Frame]:
    """Render the frames of a scene, the first at 0 s."""
    renderer = Renderer(scene)
    for index in range(scene.frames):
        yield Frame(index, Fraction(index) / scene.rate, Picture(renderer.image(index)))


def write_clip(path: Path, scene: Scene, *, overwrite: bool = False) -> None:
    """Write a scene as an H.264 video without sound.

    Raises
    ------
    OutputError
        The file cannot be written, or its suffix is not that of a video.
    """
    camera, rate = scene.camera, scene.rate
    info = VideoInfo(path, camera.width, camera.height, rate, 1 / rate, frames=scene.frames)
    with (
        staged(path, overwrite=overwrite, may_replace=may_replace_video) as temporary,
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


def _paint_sky(image: Image, scene: Scene) -> None:
    """Paint everything above the horizon, and down to the first rows of the ground."""
    rng = np.random.default_rng([scene.seed, 3])
    rows = int(scene.camera.horizon) + 3
    sky = image[:rows]
    up = np.linspace(1, 0, rows)[:, None, None]
    sky[:] = np.clip(up * np.array([168, 118, 78]) + (1 - up) * np.array([206, 186, 165]), 0, 255)
    _paint_clouds(sky, rng)
    unit = scene.camera.height / 720
    for mean, variation, color in ((88, 30, (94, 80, 66)), (34, 26, (44, 62, 60))):
        _paint_range(sky, rng, scene.camera.horizon - mean * unit, variation * unit, color)


def _paint_clouds(sky: Image, rng: np.random.Generator) -> None:
    height, width = sky.shape[:2]
    noise = cv2.resize(rng.standard_normal((6, 10)), (width, height), interpolation=cv2.INTER_CUBIC)
    noise = noise + 0.4 * cv2.resize(rng.standard_normal((18, 40)), (width, height))
    share = np.clip(0.25 * (noise - rng.uniform(-0.5, 1.5)), 0, 0.7)[..., None]
    sky[:] = (1 - share) * sky + share * 225


def _paint_range(
    sky: Image, rng: np.random.Generator, mean: float, variation: float, color: Color
) -> None:
    """Paint the part of the sky below a skyline; `mean` is the mean of its rows."""
    height, width = sky.shape[:2]
    smooth = cv2.resize(rng.standard_normal((1, 8)), (width, 1), interpolation=cv2.INTER_CUBIC)
    rough = cv2.resize(rng.standard_normal((1, 90)), (width, 1))
    skyline = mean - variation * (0.5 * smooth[0] + 0.22 * rough[0])
    rows = np.arange(height)[:, None]
    share = np.clip(rows - skyline[None, :], 0, 1)[..., None]
    grain = 1 + 0.16 * cv2.resize(rng.standard_normal((height // 4, width // 4)), (width, height))
    sky[:] = np.clip((1 - share) * sky + share * np.array(color) * grain[..., None], 0, 255)

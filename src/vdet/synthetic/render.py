"""Scenes → pictures."""

import cv2
import numpy as np
import numpy.typing as npt

from vdet.media.images import Image
from vdet.synthetic.roadside import Roadside
from vdet.synthetic.scene import Scene
from vdet.synthetic.sky import paint_sky
from vdet.synthetic.surface import Ground, brightness
from vdet.synthetic.vehicle import draw_vehicle

_SHIFT = 61  # pixels by which the noise picture is larger than a frame


class Renderer:
    """Draws the frames of one scene; what never moves is painted once."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        camera = scene.camera
        self._ground = Ground(scene)
        self._roadside = Roadside(scene)
        self._still: Image = np.zeros((camera.height, camera.width, 3), np.uint8)
        paint_sky(self._still, scene)
        self._ground.paint_base(self._still)
        self._noise = _noise(scene)

    def image(self, index: int) -> Image:
        """Return frame `index`, BGR uint8 `(H, W, 3)`."""
        station = self._scene.station(index)
        image = self._still.copy()
        self._ground.draw(image, station)
        self._roadside.draw(image, station)
        self._draw_vehicles(image, index)
        return self._as_sensed(image, index)

    def _draw_vehicles(self, image: Image, index: int) -> None:
        scene, time = self._scene, self._scene.time(index)
        for ahead, vehicle in reversed(scene.nearest_first(time)):
            light = brightness(scene, scene.station(index) + ahead)
            draw_vehicle(image, vehicle, scene.camera, time, light=light, sun=scene.light.sun)

    def _as_sensed(self, image: Image, index: int) -> Image:
        """Return the picture as a lens and a sensor give it."""
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
    """Return one frame, BGR uint8 `(H, W, 3)`; for many of a scene, use a `Renderer`."""
    return Renderer(scene).image(index)


def _noise(scene: Scene) -> npt.NDArray[np.int16]:
    """Return a picture of noise, larger than a frame, of which each frame sees another part."""
    rng = np.random.default_rng([scene.seed, 5])
    shape = (scene.camera.height + _SHIFT, scene.camera.width + _SHIFT, 3)
    noise = rng.standard_normal(shape, dtype=np.float32) * np.float32(scene.light.noise)
    return np.asarray(np.rint(noise), np.int16)

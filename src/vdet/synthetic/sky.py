"""What is too far away to move: sky, clouds, hills and a line of trees."""

import cv2
import numpy as np

from vdet.media.images import Image
from vdet.synthetic.camera import Camera
from vdet.synthetic.scene import Scene


def paint_sky(image: Image, scene: Scene) -> None:
    """Paint everything above the horizon, and down to the first rows of the ground."""
    rng = np.random.default_rng([scene.seed, 3])
    rows = int(scene.camera.horizon) + 3
    sky = image[:rows]
    up = np.linspace(1, 0, rows)[:, None, None]
    sky[:] = np.clip(up * np.array([168, 118, 78]) + (1 - up) * np.array([206, 186, 165]), 0, 255)
    _paint_clouds(sky, rng)
    unit = scene.camera.height / 720
    _paint_range(sky, rng, scene.camera, (88 * unit, 30 * unit), (94, 80, 66))
    _paint_range(sky, rng, scene.camera, (34 * unit, 26 * unit), (44, 62, 60))


def _paint_clouds(sky: Image, rng: np.random.Generator) -> None:
    height, width = sky.shape[:2]
    noise = cv2.resize(rng.standard_normal((6, 10)), (width, height), interpolation=cv2.INTER_CUBIC)
    noise = noise + 0.4 * cv2.resize(rng.standard_normal((18, 40)), (width, height))
    share = np.clip(0.25 * (noise - rng.uniform(-0.5, 1.5)), 0, 0.7)[..., None]
    sky[:] = (1 - share) * sky + share * 225


def _paint_range(
    sky: Image,
    rng: np.random.Generator,
    camera: Camera,
    heights: tuple[float, float],
    color: tuple[int, int, int],
) -> None:
    """Paint a skyline of a mean height and a variation, in pixels above the horizon."""
    height, width = sky.shape[:2]
    mean, variation = heights
    smooth = cv2.resize(rng.standard_normal((1, 8)), (width, 1), interpolation=cv2.INTER_CUBIC)
    rough = cv2.resize(rng.standard_normal((1, 90)), (width, 1))
    skyline = camera.horizon - mean - variation * (0.5 * smooth[0] + 0.22 * rough[0])
    rows = np.arange(height)[:, None]
    share = np.clip(rows - skyline[None, :], 0, 1)[..., None]
    grain = 1 + 0.16 * cv2.resize(rng.standard_normal((height // 4, width // 4)), (width, height))
    sky[:] = np.clip((1 - share) * sky + share * np.array(color) * grain[..., None], 0, 255)

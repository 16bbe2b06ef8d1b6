"""The roadside: barriers, plants, and boxes that look a little like vehicles."""

import cv2
import numpy as np

from vdet.boxes import Float64Array
from vdet.media.images import Image
from vdet.synthetic.camera import NEAR, PinholeCamera, distances, shaded
from vdet.synthetic.scene import PERIOD, RoadsideObject, Scene, Wall

_FAR = 140.0  # metres; nothing is drawn beyond
_NEAREST = 3.0
_SPRITE = 96  # side of an image of foliage, pixels
_SPRITES = 6

_Part = tuple[float, float, float, float]
"""Left, right, bottom and top of a part of an object, 0 to 1."""

_BOX: tuple[tuple[_Part, float], ...] = (
    ((0.0, 1.0, 0.0, 1.0), 1.0),
    ((0.0, 1.0, 0.9, 1.0), 1.3),
    ((0.15, 0.85, 0.55, 0.75), 0.35),
)
"""The front of a box, its lid and a dark slot, with the brightness of their colour."""


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
            if not _NEAREST < ahead < _FAR:
                continue
            if item.kind != "box":
                sprite = self._foliage[int(item.station * 10) % _SPRITES]
                _draw_foliage(image, camera, item, ahead, sprite)
            else:
                for part, factor in _BOX:
                    panel = _panel(item, ahead, part)
                    camera.draw(image, panel, shaded(item.color, factor))
        for wall in self._scene.road.walls:
            _draw_wall(image, camera, wall, station)


def _draw_wall(image: Image, camera: PinholeCamera, wall: Wall, station: float) -> None:
    z = distances(NEAR, 4 * _FAR)
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


def _panel(item: RoadsideObject, ahead: float, part: _Part = (0.0, 1.0, 0.0, 1.0)) -> Float64Array:
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
    image: Image,
    camera: PinholeCamera,
    item: RoadsideObject,
    ahead: float,
    sprite: tuple[Image, Image],
) -> None:
    """Draw the part of a tree or a bush that lies in the frame."""
    corners = camera.project(_panel(item, ahead))
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
    colored = cv2.merge([cv2.convertScaleAbs(grey, alpha=value / 128) for value in item.color])
    cv2.copyTo(
        colored, cv2.threshold(mask, 127, 255, cv2.THRESH_BINARY)[1], image[top:bottom, left:right]
    )

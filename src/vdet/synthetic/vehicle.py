"""Vehicles → outlines on the screen, and their drawing."""

import numpy as np
import numpy.typing as npt

from vdet.media.images import Image
from vdet.synthetic.camera import NEAR, Camera, Points, beyond_near
from vdet.synthetic.car import facets, footprint
from vdet.synthetic.painting import fill, shaded
from vdet.synthetic.scene import Color, Vehicle

_SHADOW: Color = (34, 32, 32)


def outlines(vehicle: Vehicle, camera: Camera, time: float) -> list[tuple[Points, Color]]:
    """Return the pixels `(n, 2)` and colour of each facet in sight, in painting order.

    Nothing is returned while the vehicle is not there.
    """
    position = vehicle.position(time)
    if position is None:
        return []
    ahead, lateral = position
    offset = np.array([lateral, 0.0, ahead])
    parts = facets(vehicle.body, vehicle.color)
    polygons = [part.corners + offset for part in parts]
    if ahead < 2 * NEAR:  # lights and plate stand out a little behind the rear
        polygons = [beyond_near(polygon) for polygon in polygons]
    ends = np.cumsum([len(polygon) for polygon in polygons])
    pixels = camera.project(np.concatenate(polygons))
    facing = _signed_areas(pixels, ends) > 0
    return [
        (pixels[end - len(polygon) : end], part.color)
        for part, polygon, end, seen in zip(parts, polygons, ends, facing, strict=True)
        if seen
    ]


def draw_vehicle(
    image: Image, vehicle: Vehicle, camera: Camera, time: float, *, light: float, sun: float
) -> None:
    """Draw a vehicle and the shadow below it onto a frame.

    `light` scales its colours (below 1 in a shadow), `sun` is `Light.sun`.
    """
    position = vehicle.position(time)
    if position is None:
        return
    ahead, lateral = position
    shadow = footprint(vehicle.body, sun) + np.array([lateral, 0.0, ahead])
    fill(image, camera.outline(shadow), _SHADOW)
    for outline, color in outlines(vehicle, camera, time):
        fill(image, outline, shaded(color, light))


def _signed_areas(pixels: Points, ends: npt.NDArray[np.intp]) -> Points:
    """Return outlines' areas in pixels, positive where corners run clockwise on the screen.

    The outlines lie one after the other in `pixels`, `(n, 2)`; an empty one has the area 0.
    """
    starts = np.concatenate([[0], ends[:-1]])
    following = np.arange(1, len(pixels) + 1)
    following[ends[ends > starts] - 1] = starts[ends > starts]
    x, y = pixels.T
    total = np.concatenate([[0.0], np.cumsum(x * y[following] - x[following] * y)])
    return np.asarray(total[ends] - total[starts]) / 2

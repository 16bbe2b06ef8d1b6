"""The lane drawn into undistorted frames, and a picture of every stage of finding it."""

import cv2
import numpy as np

from vdet.lanes.finder import Glance
from vdet.lanes.lane import Lane, Polyline
from vdet.lanes.view import View
from vdet.media.images import Image

Color = tuple[int, int, int]

AREA: Color = (80, 200, 60)
LINE: Color = (40, 60, 255)
_TEXT: Color = (255, 255, 255)
_SHADE: Color = (0, 0, 0)
_OPACITY = 0.3
_SHIFT = 4  # fractional bits of the coordinates given to OpenCV
_ENLARGED = 2  # pictures from above are small


def draw_lane(image: Image, lane: Lane) -> None:
    """Draw the lane's area and lines into an undistorted frame, and write what is told of it."""
    _draw_area(image, lane.left, lane.right)
    for number, text in enumerate(lane_text(lane)):
        _write(image, text, number)


def lane_text(lane: Lane) -> tuple[str, str]:
    """Say in words how the lane bends, and where in it the camera is."""
    side = "left" if lane.curvature < 0 else "right"
    bend = f"bends {side}, radius {lane.radius:.0f} m" if lane.radius else "straight"
    place = "right" if lane.offset > 0 else "left"
    return (
        f"lane {lane.width:.1f} m wide, {bend}",
        f"{abs(lane.offset):.2f} m {place} of its middle",
    )


def lane_pictures(image: Image, glance: Glance, lane: Lane | None, view: View) -> dict[str, Image]:
    """Return a picture of every stage: the stretch of road, seen from above, its paint, the fit.

    Parameters
    ----------
    image
        The undistorted frame, BGR uint8 `(H, W, 3)`; not changed.
    """
    road = image.copy()
    cv2.polylines(road, [_fixed(view.outline)], True, LINE, _thickness(image), cv2.LINE_AA, _SHIFT)
    fit = _enlarged(glance.above)
    if lane:
        _draw_area(fit, *(view.to_above(line) * _ENLARGED for line in (lane.left, lane.right)))
    return {
        "road": road,
        "above": _enlarged(glance.above),
        "mask": _enlarged(np.asarray(cv2.cvtColor(glance.mask, cv2.COLOR_GRAY2BGR), np.uint8)),
        "fit": fit,
    }


def _draw_area(image: Image, left: Polyline, right: Polyline) -> None:
    """Shade what is between the lines, and draw them."""
    area = np.concatenate([left, right[::-1]])
    height, width = image.shape[:2]
    x0, y0 = np.clip(area.min(axis=0), 0, (width, height)).astype(int)
    x1, y1 = np.clip(area.max(axis=0) + 2, 0, (width, height)).astype(int)
    around = image[y0:y1, x0:x1]  # the rest stays as it is
    shaded = around.copy()
    cv2.fillPoly(shaded, [_fixed(area - (x0, y0))], AREA, cv2.LINE_8, _SHIFT)
    around[:] = cv2.addWeighted(shaded, _OPACITY, around, 1 - _OPACITY, 0)
    lines = [_fixed(left), _fixed(right)]
    cv2.polylines(image, lines, False, LINE, _thickness(image), cv2.LINE_AA, _SHIFT)


def _write(image: Image, text: str, number: int) -> None:
    """Write a line of text into the upper left corner."""
    scale = max(0.35, len(image) / 900)
    thickness = max(1, round(2 * scale))
    origin = round(20 * scale), round(40 * scale * (number + 1))
    font = cv2.FONT_HERSHEY_SIMPLEX
    cv2.putText(image, text, origin, font, scale, _SHADE, 3 * thickness, cv2.LINE_8)
    cv2.putText(image, text, origin, font, scale, _TEXT, thickness, cv2.LINE_AA)


def _enlarged(picture: Image) -> Image:
    size = (picture.shape[1] * _ENLARGED, picture.shape[0] * _ENLARGED)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_NEAREST), np.uint8)


def _thickness(image: Image) -> int:
    return max(1, len(image) // 240)


def _fixed(points: Polyline) -> np.ndarray[tuple[int, ...], np.dtype[np.int32]]:
    return np.rint(points * (1 << _SHIFT)).astype(np.int32)

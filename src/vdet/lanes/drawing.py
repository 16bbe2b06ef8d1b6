"""The lane drawn into undistorted frames, and a picture of every stage of finding it."""

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Float64Array
from vdet.draw.boxes import draw_label, line_width
from vdet.draw.paint import Color
from vdet.lanes.lane import Lane
from vdet.lanes.top_view import TopView
from vdet.media.images import Image

AREA: Color = (80, 200, 60)
LINE: Color = (40, 60, 255)
_OPACITY = 0.3
_SHIFT = 4  # fractional bits of the coordinates given to OpenCV
_SCALE = 2  # top views are small, so their pictures are enlarged


def draw_lane(image: Image, lane: Lane) -> None:
    """Draw the lane's area and lines into an undistorted frame, and write its numbers."""
    _draw_area(image, lane.left, lane.right)
    first, second = lane_text(lane)
    tag = draw_label(image, first, (0, 0), AREA)
    draw_label(image, second, (0, 2 * tag.height), AREA)


def lane_text(lane: Lane) -> tuple[str, str]:
    """Return two lines of text: the lane's width and bend, and the camera's place in it."""
    side = "left" if lane.curvature < 0 else "right"
    bend = f"bends {side}, radius {lane.radius:.0f} m" if lane.radius else "straight"
    place = "right" if lane.offset > 0 else "left"
    return (
        f"lane {lane.width:.1f} m wide, {bend}",
        f"{abs(lane.offset):.2f} m {place} of its middle",
    )


def stage_pictures(
    image: Image, top: Image, mask: Image, lane: Lane | None, top_view: TopView
) -> dict[str, Image]:
    """Return pictures of the stages: `road`, `above`, `mask` and `fit`, BGR uint8.

    Parameters
    ----------
    image
        The undistorted frame, BGR uint8 `(H, W, 3)`; `road` shows the outline of the top view
        in it.
    top
        The top view of the frame, BGR uint8 `(rows, columns, 3)`; `above`, and `fit` with the lane.
    mask
        The paint in the top view, uint8 `(rows, columns)`; what vehicles hide is grey.
    """
    road = image.copy()
    outline = _fixed_point(top_view.outline)
    cv2.polylines(road, [outline], True, LINE, line_width(image), cv2.LINE_AA, _SHIFT)
    fit = _enlarge(top)
    if lane:
        _draw_area(fit, *(top_view.frame_to_top(line) * _SCALE for line in (lane.left, lane.right)))
    return {
        "road": road,
        "above": _enlarge(top),
        "mask": _enlarge(np.asarray(cv2.cvtColor(mask, cv2.COLOR_GRAY2BGR), np.uint8)),
        "fit": fit,
    }


def _draw_area(image: Image, left: Float64Array, right: Float64Array) -> None:
    """Tint the area between two lines, pixels `(n, 2)`, and draw the lines."""
    area = np.concatenate([left, right[::-1]])
    height, width = image.shape[:2]
    x0, y0 = np.clip(area.min(axis=0), 0, (width, height)).astype(int)
    x1, y1 = np.clip(area.max(axis=0) + 2, 0, (width, height)).astype(int)
    around = image[y0:y1, x0:x1]  # blend only the part that changes
    tinted = around.copy()
    cv2.fillPoly(tinted, [_fixed_point(area - (x0, y0))], AREA, cv2.LINE_8, _SHIFT)
    around[:] = cv2.addWeighted(tinted, _OPACITY, around, 1 - _OPACITY, 0)
    lines = [_fixed_point(left), _fixed_point(right)]
    cv2.polylines(image, lines, False, LINE, line_width(image), cv2.LINE_AA, _SHIFT)


def _enlarge(picture: Image) -> Image:
    size = (picture.shape[1] * _SCALE, picture.shape[0] * _SCALE)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_NEAREST), np.uint8)


def _fixed_point(points: Float64Array) -> npt.NDArray[np.int32]:
    return np.rint(points * (1 << _SHIFT)).astype(np.int32)

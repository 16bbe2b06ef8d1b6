"""The lane drawn into frames, and a picture of every stage of finding it."""

import cv2
import numpy as np

from vdet.boxes import Float64Array, Image
from vdet.draw.boxes import draw_label, line_width
from vdet.draw.paint import Color, Surface, draw_lines, shade
from vdet.lanes.road import Lane, Road

AREA: Color = (80, 200, 60)
LINE: Color = (40, 60, 255)
_OPACITY = 0.3
_SCALE = 2  # top views are small, so their pictures are enlarged


def draw_lane(surface: Surface, lane: Lane) -> None:
    """Draw the lane's area and lines into a frame, and write its numbers."""
    _draw_area(surface, lane.left, lane.right)
    y = 0.0
    for line in lane_text(lane):
        y += 2 * draw_label(surface, line, (0, y), AREA).height


def lane_text(lane: Lane) -> tuple[str, ...]:
    """Return two lines of text: the lane's width and bend, and the camera's place in it.

    There is none for a lane without metres.
    """
    if lane.width is None or lane.offset is None:
        return ()
    side = "left" if lane.curvature < 0 else "right"
    bend = f"bends {side}, radius {lane.radius:.0f} m" if lane.radius else "straight"
    place = "right" if lane.offset > 0 else "left"
    return (
        f"lane {lane.width:.1f} m wide, {bend}",
        f"{abs(lane.offset):.2f} m {place} of its middle",
    )


def stage_pictures(road: Road) -> dict[str, Image]:
    """Return pictures of the stages, BGR uint8.

    `road` is the undistorted frame with the outline of the top view, `above` the top view, `mask`
    its paint (what vehicles hide is grey), and `fit` the top view with the lane.
    """
    frame = road.undistorter.image(road.view.picture.image)
    above = _enlarge(road.top_view.picture(frame))
    fit = above.copy()
    if lane := road.lane:
        straight = (road.undistorter.points(line) for line in (lane.left, lane.right))
        _draw_area(fit, *(road.top_view.frame_to_top(line) * _SCALE for line in straight))
    draw_lines(frame, road.top_view.outline, LINE, line_width(frame), closed=True)
    mask = np.asarray(cv2.cvtColor(road.view.mask, cv2.COLOR_GRAY2BGR), np.uint8)
    return {"road": frame, "above": above, "mask": _enlarge(mask), "fit": fit}


def _draw_area(surface: Surface, left: Float64Array, right: Float64Array) -> None:
    """Tint the area between two lines, pixels `(n, 2)`, and draw the lines."""
    shade(surface, [(x, y) for x, y in [*left.tolist(), *right[::-1].tolist()]], AREA, _OPACITY)
    for line in (left, right):
        draw_lines(surface, line, LINE, line_width(surface))


def _enlarge(picture: Image) -> Image:
    return picture.repeat(_SCALE, axis=0).repeat(_SCALE, axis=1)

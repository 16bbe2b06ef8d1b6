"""The road in the frames of a video: its lane, positions on it, and their drawings.

`RoadFinder.observe` does the work that needs one frame only. `RoadFinder.update` takes the frames
in order: it fits the lane near the last one, or finds a new one, and smooths it over time.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from vdet.boxes import Box, Float64Array, Image
from vdet.config.scene import LensSettings
from vdet.config.schema import LaneSettings
from vdet.draw.boxes import Color, Surface, draw_label, draw_lines, line_width, shade
from vdet.lanes.camera import Maps, TopView, Undistorter, warped
from vdet.lanes.curves import FrameFit, LaneCurves, fit_near, fit_new, hide, paint_mask
from vdet.media import Picture
from vdet.media.images import to_ycrcb

CARRY = 12
"""Number of frames for which a line is kept that is not seen."""
_CURVE_MEMORY = 0.95
"""Weight of the earlier frames in the radius that is shown."""
_STRAIGHT = 5000.0
"""Radius from which the road counts as straight, metres."""
_LINE_POINTS = 24  # of each line of a `Lane`
_REACH = 1.25
"""Farthest reported vehicle, as a multiple of the distance up to which the lane is fitted."""
_MAX_ROW_ERROR = 0.1
"""Maximum relative error of a distance for an error of one row; it is larger near the horizon."""
_LANES = 3
"""Number of lanes to each side of the camera's lane that are reported."""


@dataclass(frozen=True, slots=True)
class Lane:
    """The lane that the camera is in: its shape in metres, its two lines in pixels.

    The lines are in the frame, `(n, 2)` as `x, y`, and begin at the nearest point.
    """

    curvature: float
    """1/m, positive in a bend to the right; smoothed over more frames than the lines."""
    radius: float | None
    """Radius of the bend, metres; None if the road is straight (5000 m or more)."""
    offset: float | None
    """Distance of the camera from the middle of the lane, metres; positive: it is to the right.
    None, like the radius and the width, where the camera is not described.
    """
    width: float | None
    """Width of the lane, metres."""
    left: Float64Array
    right: Float64Array

    def record(self) -> dict[str, Any]:
        """Return plain values for JSON.

        `radius` (None on a straight road), `offset` and `width` are metres, rounded to millimetres;
        all are None where the camera is not described.
        `left` and `right` are `[[x, y], …]`, pixels, rounded to tenths.
        """
        metres = {"radius": self.radius, "offset": self.offset, "width": self.width}
        rounded = {name: value and round(value, 3) for name, value in metres.items()}
        left, right = (np.round(line, 1).tolist() for line in (self.left, self.right))
        return {**rounded, "left": left, "right": right}


@dataclass(frozen=True, slots=True)
class RoadPosition:
    """Where a point is on the road."""

    distance: float
    """Metres along the road from below the camera's lens."""
    lane: int | None
    """0 for the camera's lane, 1 for the next one to the right, -1 to the left and so on; None for
    one that is too far to the side."""


def position_on_road(
    point: tuple[float, float], curves: LaneCurves, top_view: TopView
) -> RoadPosition | None:
    """Return where on the road a point of the undistorted frame is.

    `point` is `(x, y)`, pixels; whole numbers are pixel centres. None if it is above or near the
    horizon, or farther away than the lane reaches.

    1 / z in the top view grows by the same amount with every row below the horizon. A camera that
    pitches by a little moves all rows by the same amount, so the true distance Z is given by
    1 / Z = 1 / z - pitch. The other lanes are assumed to be as wide as the camera's lane, and to
    follow the same curve.
    """
    x, y = point
    slope, nearness = top_view.sight(point)
    _, below = top_view.sight((x, y + 1))
    nearness, row = nearness - curves.pitch, below - nearness
    farthest = _REACH * float(top_view.distances[0])
    if not (nearness * farthest >= 1 and row <= _MAX_ROW_ERROR * nearness):  # also for NaN
        return None
    distance = 1 / nearness
    shift = curves.heading * distance + curves.bend * distance**2  # of all lines, at the distance
    from_left = slope * distance - shift - curves.left
    lane = math.floor(from_left / curves.width)
    return RoadPosition(distance, lane if abs(lane) <= _LANES else None)


@dataclass(frozen=True, slots=True)
class Road:
    """The road in one frame of a video."""

    size: tuple[int, int]
    """Width and height of the frame, pixels."""
    mask: Image
    """The paint in the top view, from `RoadFinder.observe`; vehicles are `HIDDEN`."""
    lane: Lane | None
    """The lane, smoothed over this frame and those before; None if it is not reliably known."""
    curves: LaneCurves | None
    """The lines of `lane` on the ground; None without a lane, or without metres."""
    top_view: TopView
    undistorter: Undistorter
    """Moves boxes and points of the frame to the undistorted one."""

    def record(self) -> dict[str, Any] | None:
        """Return the lane as plain values for JSON."""
        return self.lane.record() if self.lane else None

    def cuts(self, box: Box) -> bool:
        """Return whether the left, right or lower edge of the frame cuts the vehicle's box."""
        return bool(box.cut_by(self.size).hide_foot)

    def position(self, point: tuple[float, float]) -> RoadPosition | None:
        """Return where on the road a vehicle is that stands at a point of the frame.

        `point` is `(x, y)`, pixels; whole numbers are the edges of pixels, as in boxes. None
        without a lane or metres, and where the lane does not reach: see `position_on_road`.
        """
        if self.curves is None:
            return None
        [[x, y]] = self.undistorter.points(np.array([point]) - 0.5)
        return position_on_road((x, y), self.curves, self.top_view)


@dataclass(frozen=True, slots=True)
class _LaneState:
    """The lane according to the frames so far."""

    fit: FrameFit
    unseen: tuple[int, int]
    """Number of frames since the left and the right line were last seen."""
    curvature: float
    """1/m, smoothed over more frames than the curves."""


class RoadFinder:
    """Warps the frames of one video, `width` × `height` pixels, and finds the lane in them.

    Several threads may call `observe` at the same time. `update` must get the results one by one,
    in the order of the frames. Without `has_metres`, lanes have no values that need the description
    of a camera, and vehicles no positions.

    Raises
    ------
    ConfigError
        The aspect ratio of the frames is not the camera's.
    """

    def __init__(
        self,
        lens: LensSettings | None,
        settings: LaneSettings,
        width: int,
        height: int,
        *,
        has_metres: bool = True,
    ) -> None:
        self._size, self._has_metres = (width, height), has_metres
        self._undistorter = Undistorter(lens, width, height)
        self._top_view = TopView(settings, width, height)
        self._state: _LaneState | None = None
        far, near = self._top_view.distances[[0, -1]]
        self._lane_z = np.geomspace(near, far, _LINE_POINTS)
        """Distances of the points of a `Lane`, metres."""
        shown = self._top_view.pixels()
        seen = self._undistorter.distorted(shown.reshape(-1, 2)).reshape(shown.shape)
        self._maps: list[Maps] = [
            cv2.convertMaps(pixels[..., 0], pixels[..., 1], cv2.CV_16SC2)
            for pixels in np.array([seen, (seen + 0.5) / 2 - 0.5], np.float32)
        ]
        """Where the pixels of the top view lie in the frame, and in its chroma."""

    def observe(self, picture: Picture) -> Image:
        """Return the paint in the top view of a frame, 255, else 0, uint8 `(rows, columns)`."""
        of_frame, of_chroma = self._maps
        if planes := picture.planes:
            luma, blue = warped(planes.luma, of_frame), warped(planes.blue, of_chroma, outside=128)
            no_red = np.full_like(blue, 128)  # saves time; roads and paint have little red
            luma, blue, _ = planes.coding.to_common((luma, blue, no_red))
        else:
            luma, _, blue = to_ycrcb(warped(picture.image, of_frame))
        return paint_mask(luma, blue)

    def update(self, mask: Image, vehicles: Iterable[Box] = ()) -> Road:
        """Return the road in the next frame, from its paint.

        `vehicles` are the boxes of the vehicles in it, which hide paint.
        """
        boxes = [self._undistorter.box(box) for box in vehicles]
        mask = hide(mask, self._top_view, boxes)
        self._state = state = self._next_state(mask)
        return Road(
            size=self._size,
            mask=mask,
            lane=self._lane(state) if state else None,
            curves=state.fit.curves if state and self._has_metres else None,
            top_view=self._top_view,
            undistorter=self._undistorter,
        )

    def _next_state(self, mask: Image) -> _LaneState | None:
        """Fit near the last lane; else find a new one; else keep the last one for some frames."""
        state = self._state
        near = fit_near(mask, self._top_view, state.fit.curves) if state else None
        if state and near and (updated := _advance(state, near)):
            return updated
        if new := fit_new(mask, self._top_view):
            return _LaneState(new, unseen=(0, 0), curvature=2 * new.curves.bend)
        return _advance(state, None) if state and not near else None

    def _lane(self, state: _LaneState) -> Lane:
        curves, curvature = state.fit.curves, state.curvature
        z = self._lane_z
        lines = self._top_view.ground_to_frame(np.concatenate(curves.at(z)), np.tile(z, 2))
        left, right = np.split(self._undistorter.distorted(lines), 2)
        if not self._has_metres:
            return Lane(curvature, radius=None, offset=None, width=None, left=left, right=right)
        radius = None if abs(curvature) * _STRAIGHT < 1 else 1 / abs(curvature)
        offset = -(curves.left + curves.right) / 2
        return Lane(curvature, radius, offset, curves.width, left=left, right=right)


def _advance(state: _LaneState, fit: FrameFit | None) -> _LaneState | None:
    """Add the fit of the next frame, None if it shows no lane; None if the lane is lost.

    The lane is lost if one of its lines was not seen in more than `CARRY` frames in a
    row, or if the camera has left it.
    """
    sees_left, sees_right = fit.seen if fit else (False, False)
    left, right = state.unseen
    unseen = 0 if sees_left else left + 1, 0 if sees_right else right + 1
    joined, curvature = state.fit, state.curvature
    if fit:
        joined = fit.with_earlier(state.fit)
        curvature += (1 - _CURVE_MEMORY) * (2 * joined.curves.bend - curvature)
    if max(unseen) > CARRY or not joined.curves.contain_camera:
        return None
    return _LaneState(joined, unseen, curvature)


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
    """Return two lines of text: the lane's width and bend, and the camera's position in it.

    It is empty for a lane without metres.
    """
    if lane.width is None or lane.offset is None:
        return ()
    bend_side = "left" if lane.curvature < 0 else "right"
    camera_side = "left" if lane.offset <= 0 else "right"
    bend = f"bends {bend_side}, radius {lane.radius:.0f} m" if lane.radius else "straight"
    middle = f"{abs(lane.offset):.2f} m {camera_side} of its middle"
    return f"lane {lane.width:.1f} m wide, {bend}", middle


def stage_images(road: Road, image: Image) -> dict[str, Image]:
    """Return pictures of the stages of a frame, BGR uint8.

    `road` is the undistorted frame with the outline of the top view, `above` the top view, `mask`
    its paint (what vehicles hide is grey), and `fit` the top view with the lane.
    """
    frame = road.undistorter.image(image)
    above = _enlarge(road.top_view.picture(frame))
    fit = above.copy()
    if lane := road.lane:
        left, right = (
            road.top_view.frame_to_top(road.undistorter.points(line)) * _SCALE
            for line in (lane.left, lane.right)
        )
        _draw_area(fit, left, right)
    draw_lines(frame, road.top_view.outline, LINE, line_width(frame), closed=True)
    mask = np.asarray(cv2.cvtColor(road.mask, cv2.COLOR_GRAY2BGR), np.uint8)
    return {"road": frame, "above": above, "mask": _enlarge(mask), "fit": fit}


def _draw_area(surface: Surface, left: Float64Array, right: Float64Array) -> None:
    """Tint the area between two lines, pixels `(n, 2)`, and draw the lines."""
    shade(surface, [(x, y) for x, y in [*left.tolist(), *right[::-1].tolist()]], AREA, _OPACITY)
    for line in (left, right):
        draw_lines(surface, line, LINE, line_width(surface))


def _enlarge(picture: Image) -> Image:
    return picture.repeat(_SCALE, axis=0).repeat(_SCALE, axis=1)

"""The road in the frames of a video: each frame undistorted, with its lane.

`RoadFinder.observe` does what needs one frame alone. `RoadFinder.update` takes the frames in their
order: it fits the lane near the last one, or finds a new one, and smooths it over time.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from vdet.boxes import Box, Float64Array
from vdet.config.lanes import LaneSettings
from vdet.lanes.camera import CalibratedCamera, Undistorter
from vdet.lanes.curves import LaneCurves, NormalEquations, solve
from vdet.lanes.drawing import stage_pictures
from vdet.lanes.frame_fit import FrameFit, fit_near, fit_new
from vdet.lanes.lane import Lane
from vdet.lanes.paint import hide, paint_mask
from vdet.lanes.position import RoadPosition, position_on_road
from vdet.lanes.top_view import TopView
from vdet.media.images import Image

CARRY = 12
"""Number of frames for which an unseen line is kept."""
_MEMORY = 0.6
"""Weight of the frames before, where the newest frame has weight 1."""
_CURVE_MEMORY = 0.95
"""Share of the frames before in the radius that is shown."""
_STRAIGHT = 5000.0
"""Radius from which the road counts as straight, metres."""
_EDGE = 0.005
"""A box that ends this near to the frame's edge is cut off: share of the width or height."""
_LINE_POINTS = 24  # of each line of a `Lane`


@dataclass(frozen=True, slots=True)
class LaneRequest:
    """Ask for lanes; `camera` took the frames, None if they are undistorted already."""

    camera: CalibratedCamera | None = None


@dataclass(frozen=True, slots=True)
class FrameView:
    """One frame, prepared for the lane search."""

    image: Image
    """The undistorted frame, BGR uint8 `(H, W, 3)`; the frame itself if there is no camera."""
    top: Image
    """The road from above, BGR uint8 `(rows, columns, 3)`."""
    mask: Image
    """The paint on it, uint8 `(rows, columns)`: 255 for paint, else 0."""


@dataclass(frozen=True, slots=True)
class Road:
    """The road in one frame of a video."""

    view: FrameView
    """The frame's pictures, from `RoadFinder.observe`; in `mask`, vehicles are `paint.HIDDEN`."""
    lane: Lane | None
    """The lane, smoothed over this frame and those before; None if it is not reliably known."""
    curves: LaneCurves | None
    """The lines of `lane` on the ground; None if there is no lane."""
    top_view: TopView
    undistorter: Undistorter | None

    @property
    def image(self) -> Image:
        """The undistorted frame, BGR uint8 `(H, W, 3)`; the frame itself if there is no camera."""
        return self.view.image

    def place(self, box: Box) -> Box:
        """Return the box in `image` for a box in the original frame; area 0 if it lies outside."""
        return self.undistorter.box(box) if self.undistorter else box

    def place_points(self, points: Float64Array) -> Float64Array:
        """Return where points `(n, 2)` of the original frame, x and y, lie in `image`."""
        return self.undistorter.points(points) if self.undistorter else points

    def cuts(self, box: Box) -> bool:
        """Tell whether the original frame's left, right or lower edge cuts a box in that frame."""
        height, width = self.image.shape[:2]
        beside = box.x1 <= _EDGE * width or box.x2 >= (1 - _EDGE) * width
        return bool(beside or box.y2 >= (1 - _EDGE) * height)

    def position(self, foot: tuple[float, float]) -> RoadPosition | None:
        """Return where on the road a vehicle is that stands at `foot` in the original frame.

        `foot` is `(x, y)` in pixels; whole numbers are the edges of pixels, as in boxes. None
        without a lane, and where the lane does not reach: see `position_on_road`.
        """
        if self.curves is None:
            return None
        pixel = np.array([foot]) - 0.5
        [[x, y]] = self.place_points(pixel)
        return position_on_road((x, y), self.curves, self.top_view)

    def pictures(self) -> dict[str, Image]:
        """Return a picture of every stage of finding the lane, as `stage_pictures` makes them."""
        view = self.view
        return stage_pictures(view.image, view.top, view.mask, self.lane, self.top_view)


@dataclass(frozen=True, slots=True)
class _LaneState:
    """What the frames so far say about the lane."""

    curves: LaneCurves
    equations: NormalEquations
    unseen: tuple[int, int]
    """Number of frames since the left and the right line were last seen."""
    curvature: float
    """1/m, smoothed over more frames than the curves."""


class RoadFinder:
    """Undistorts the frames of one video, `width` × `height` pixels, and finds the lane in them.

    Several threads may call `observe` at the same time. `update` must get the results one by one,
    in the order of the frames.

    Raises
    ------
    ConfigError
        The aspect ratio of the frames is not the camera's.
    """

    def __init__(
        self, request: LaneRequest, settings: LaneSettings, width: int, height: int
    ) -> None:
        camera = request.camera
        self._settings = settings
        self._undistorter = Undistorter(camera, width, height) if camera else None
        self._top_view = TopView(settings, width, height)
        self._state: _LaneState | None = None

    def observe(self, image: Image) -> FrameView:
        """Undistort a frame, BGR uint8 `(H, W, 3)`, and mark the paint in its top view."""
        undistorted = self._undistorter.image(image) if self._undistorter else image
        top = self._top_view.image(undistorted)
        mask = paint_mask(top)
        return FrameView(undistorted, top, mask)

    def update(self, view: FrameView, vehicles: Iterable[Box] = ()) -> Road:
        """Return the road in the next frame.

        `vehicles` are the boxes of those in it, in the original frame. They hide paint.
        """
        placed = [self._undistorter.box(box) if self._undistorter else box for box in vehicles]
        view = replace(view, mask=hide(view.mask, self._top_view, placed))
        self._state = self._next_state(view.mask)
        lane, curves = (
            (self._lane(self._state), self._state.curves) if self._state else (None, None)
        )
        return Road(view, lane, curves, self._top_view, self._undistorter)

    def _next_state(self, mask: Image) -> _LaneState | None:
        """Fit near the last lane; else find a new one; else keep the last one for some frames."""
        settings, state = self._settings, self._state
        near = fit_near(mask, self._top_view, state.curves, settings) if state else None
        if state and near and (updated := _advance(state, near)):
            return updated
        if new := fit_new(mask, self._top_view, settings):
            return _LaneState(new.curves, new.equations, (0, 0), 2 * new.curves.bend)
        return _advance(state, None) if state and not near else None

    def _lane(self, state: _LaneState) -> Lane:
        curves, curvature = state.curves, state.curvature
        far, near = self._top_view.distances[[0, -1]]
        z = np.geomspace(near, far, _LINE_POINTS)
        left, right = curves.at(z)
        straight = abs(curvature) * _STRAIGHT < 1
        return Lane(
            curvature=curvature,
            radius=None if straight else 1 / abs(curvature),
            offset=-(curves.left + curves.right) / 2,
            width=curves.width,
            left=self._top_view.ground_to_frame(left, z),
            right=self._top_view.ground_to_frame(right, z),
        )


def _advance(state: _LaneState, fit: FrameFit | None) -> _LaneState | None:
    """Add the fit of the next frame, None if it shows no lane; None if the lane is lost.

    The lane is lost if one of its lines was not seen in more than `CARRY` frames in a
    row, or if the camera has left it.
    """
    seen = fit.seen if fit else (False, False)
    left, right = (0 if now else before + 1 for now, before in zip(seen, state.unseen, strict=True))
    curves, equations, curvature = state.curves, state.equations, state.curvature
    if fit:
        equations = fit.equations.plus_earlier(equations, _MEMORY)
        curves = solve(equations, curves.width)
        curvature += (1 - _CURVE_MEMORY) * (2 * curves.bend - curvature)
    if max(left, right) > CARRY or not curves.contain_camera:
        return None
    return _LaneState(curves, equations, (left, right), curvature)

"""The lane in the frames of a video: the paint of its lines, their curves, positions on the road.

A painted line has the same width at all distances in the top view. A pixel counts as paint if it
is lighter or yellower than the road a little to its left *and* a little to its right. At the edge
of a shadow, a kerb or pale concrete only one side is darker. Lightness is compared relative to the
road's own, so a line in a shadow is found too. Yellow paint differs from pale concrete by colour.

The lines of a lane are parallel, so they share curvature and heading. A vehicle that pitches up or
down sees parallel lines converge or diverge. With z the distance ahead at which a point appears in
the top view, the camera sees each line at::

    scale(z) = 1 - pitch · z
    x(z) = position · scale(z) + heading · z + bend · z² / scale(z)

This is position + heading · Z + bend · Z² at the true distance Z = z / scale(z). A pitch makes Z
look like z, and widths there look scale(z) times as large.

The curves are linear in their five parameters, except for two products with the pitch. There a
guess takes the place of the other factor. Every painted row has the same weight. Normal equations
of several frames can be added, so earlier frames count with less weight and need no second fit.

`RoadFinder.observe` does the work that needs one frame only. `RoadFinder.update` takes the frames
in order: it fits the lane near the last one, or finds a new one, and smooths it over time.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from vdet.boxes import Box, Float64Array, Image
from vdet.config.scene import LensSettings
from vdet.config.schema import LaneSettings
from vdet.draw import Color, Surface, draw_label, draw_lines, line_width, shade
from vdet.lanes.camera import ACROSS, ALONG, Maps, TopView, Undistorter, warped
from vdet.media import Picture
from vdet.media.images import to_ycrcb

LinePositions = tuple[Float64Array, Float64Array]
"""x of the left and of the right line at each row of the top view, metres, each `(rows,)`."""

PAINT, HIDDEN = 255, 128
"""Values of a mask of paint: paint, and what a vehicle hides; the rest is 0."""

MARGIN = 0.5
"""Largest distance of paint from the middle of its window or the last frame's curve, metres."""
FINE_MARGIN = 0.2
"""Largest distance of paint from a curve that was fitted to this frame, metres."""
WIDTH_TOLERANCE = 0.6
"""Largest difference between the width of the lane and that in `lanes.metres`."""

_LINE_WIDTH = 0.15
"""Width of a painted line, metres."""
_LINE_REACH = 0.35
"""Distance to the road on the left and right with which a pixel is compared, metres."""
_RISE, _MIN_RISE = 0.10, 10.0
"""Minimum rise in lightness from the road to paint: fraction of the road's, and of 0 to 255."""
_MIN_RISES = np.maximum(np.arange(256) * np.float32(_RISE), _MIN_RISE).astype(np.uint8)
"""The minimum rise in whole values, by the lightness of the road."""
_YELLOW = 9.0
"""Minimum fall in blue chroma from the road to yellow paint, of 0 to 255."""
_BASE = 15.0
"""Length of the nearest part of the road, which the histogram covers, metres."""
_WINDOW = 3.0
"""Length of a sliding window, metres."""

_MIN_SCALE = 0.3  # the pitch of a real vehicle keeps the scale above this
_PITCH = 4  # index of the pitch among the five parameters, in the order of `LaneCurves`

# Prior knowledge: how many painted rows (deviation 0.1 m) a typical deviation counts as.
_BEND_WEIGHT = (0.1 / 0.001) ** 2
_PITCH_WEIGHT = (0.1 / 0.003) ** 2
_WIDTH_WEIGHT = (0.1 / 0.2) ** 2
_MIN_WEIGHT = 1e-3  # keeps the equations solvable
_APART = np.array([0, 0, -1, 1, 0])  # the width, from the five parameters
_PRIOR = np.diag([_BEND_WEIGHT, _MIN_WEIGHT, _MIN_WEIGHT, _MIN_WEIGHT, _PITCH_WEIGHT])
_PRIOR += _WIDTH_WEIGHT * np.outer(_APART, _APART)

_MIN_VISIBLE = 0.25
"""Visible fraction of a line below which it needs no less paint: a little can be anything."""
_MARKING = 4.0
"""Shortest length of paint by which a wholly visible line is seen, metres."""
_SCATTER = 0.08
"""Largest root mean square distance of paint from its curve, metres."""
_BESIDE, _ALONE = 0.75, 0.85
"""Distance to each side, metres, and minimum fraction of the paint up to there that is on the line:
it is 0.9 to 1 on painted lines, and less on verges, crossings and reflections.
"""
_CONVERGENCE = 1.6
"""Maximum convergence of the lines over the top view, metres; it comes from the vehicle's pitch."""
_MIN_RADIUS = 150.0
"""Smallest radius of a bend, metres."""
_JUMP = 0.35
"""Largest sideways move of a line between two frames, metres."""
_MEMORY = 0.6
"""Weight of the frames before, where the newest frame has weight 1."""

Equations = Float64Array
"""Normal equations of a least-squares fit of `LaneCurves`, `(5, 6)`: the matrix, and the vector in
the last column."""

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

AREA: Color = (80, 200, 60)
LINE: Color = (40, 60, 255)
_OPACITY = 0.3
_SCALE = 2  # top views are small, so their pictures are enlarged


@dataclass(frozen=True, slots=True)
class LinePaint:
    """Paint that may belong to one line: its distances and lateral positions, metres `(n,)`."""

    z: Float64Array
    x: Float64Array
    visible: float = 1.0
    """Fraction of all rows in which no vehicle hides the line."""
    pixels: int = 0
    """Number of painted pixels of the top view."""


def paint_mask(luma: Image, blue: Image) -> Image:
    """Return 255 for paint and 0 for the rest, uint8 `(rows, columns)`.

    `luma` and `blue` (chroma) show the road from above, uint8 `(rows, columns)`, in limited range.
    """
    width = round(_LINE_WIDTH * ACROSS) | 1  # odd, so that the blur does not shift lines
    reach = round(_LINE_REACH * ACROSS)
    layers = luma, cv2.bitwise_not(blue)
    lightness, yellow = (np.asarray(cv2.blur(item, (width, 3)), np.uint8) for item in layers)
    road = _larger_side(lightness, reach)
    rise = cv2.subtract(lightness, road)  # saturates at 0
    tint = cv2.subtract(yellow, _larger_side(yellow, reach))
    paint = cv2.compare(rise, cv2.LUT(road, _MIN_RISES), cv2.CMP_GT)
    _, yellow_paint = cv2.threshold(tint, _YELLOW, PAINT, cv2.THRESH_BINARY)
    return np.asarray(cv2.bitwise_or(paint, yellow_paint), np.uint8)


def _larger_side(channel: Image, reach: int) -> Image:
    """Return the larger of the values `reach` columns to the left and to the right."""
    padded = cv2.copyMakeBorder(channel, 0, 0, reach, reach, cv2.BORDER_CONSTANT, value=(255,))
    columns = channel.shape[1]
    return np.asarray(cv2.max(padded[:, :columns], padded[:, 2 * reach :]), np.uint8)


def hide(mask: Image, top_view: TopView, boxes: Iterable[Box]) -> Image:
    """Return the mask with `HIDDEN` where vehicles, boxes in the undistorted frame, hide the road.

    Seen from above, a vehicle covers everything behind it.
    """
    farthest = top_view.outline[:, 1].min()
    hidden = mask.copy()
    for box in boxes:
        x1, x2 = box.x1 - 0.5, box.x2 - 0.5
        y1, y2 = max(box.y1 - 0.5, farthest), box.y2 - 0.5
        if y1 < y2:
            corners = np.array([[x1, y1], [x2, y1], [x2, y2], [x1, y2]])
            outline = np.rint(top_view.frame_to_top(corners)).astype(np.int32)
            cv2.fillConvexPoly(hidden, outline, (HIDDEN,))
    return hidden


def paint_along(
    mask: Image, top_view: TopView, lines: Sequence[Float64Array], margin: float
) -> list[LinePaint]:
    """Return the middle of the paint within `margin` metres of each line, row by row.

    Each of `lines` is the x of a line in each row, metres `(rows,)`. A row is left out if a part of
    it is hidden near the line, because the middle of the visible part would be wrong.
    """
    half = max(1, round(margin * ACROSS))
    around = np.arange(-half, half + 1)
    columns = np.rint((np.stack(lines) - top_view.laterals[0]) * ACROSS)
    middles = np.clip(columns, -half - 1, mask.shape[1] + half).astype(np.intp)
    padded = cv2.copyMakeBorder(mask, 0, 0, 2 * half + 1, 2 * half + 1, cv2.BORDER_CONSTANT)
    first = np.arange(len(mask)) * padded.shape[1] + 2 * half + 1
    near = np.asarray(padded, np.uint8).ravel()[(middles + first)[..., None] + around]
    visible = (near != HIDDEN).all(axis=2)
    # one product counts the painted columns and adds up their offsets
    weights = np.stack([np.ones_like(around), around], axis=1, dtype=np.float32)
    counts, moments = np.moveaxis((near == PAINT).astype(np.float32) @ weights, 2, 0)
    x = top_view.laterals[0] + (middles + moments / np.maximum(counts, 1)) / ACROSS
    return [
        LinePaint(
            top_view.distances[rows], of_line[rows], float(seen.mean()), int(count[rows].sum())
        )
        for of_line, rows, seen, count in zip(
            x, (counts > 0) & visible, visible, counts, strict=True
        )
    ]


def find_base(mask: Image, top_view: TopView) -> tuple[float, float] | None:
    """Return x of both lines near the camera, metres: the best pair of peaks in the histogram.

    The pair has one line on each side of the camera, about a lane's width apart. None if there is
    no such pair.
    """
    near = top_view.distances < top_view.distances[-1] + _BASE
    counts = np.count_nonzero(mask[near] == PAINT, axis=0).astype(np.float64)
    spread = round(FINE_MARGIN * ACROSS) | 1
    histogram = np.asarray(cv2.blur(counts[None], (spread, 1)), np.float64).ravel()
    expected = top_view.lane_width
    narrowest = round((expected - WIDTH_TOLERANCE) * ACROSS)
    widest = round((expected + WIDTH_TOLERANCE) * ACROSS)
    best, base = 0.0, None
    for gap in range(max(1, narrowest), widest + 1):
        left, right = top_view.laterals[:-gap], top_view.laterals[gap:]
        score = histogram[:-gap] * histogram[gap:] * ((left < 0) & (right > 0))
        peak = int(score.argmax())
        if score[peak] > best:
            best, base = float(score[peak]), (float(left[peak]), float(right[peak]))
    return base


def slide_windows(mask: Image, top_view: TopView, base: tuple[float, float]) -> LinePositions:
    """Follow both lines with sliding windows, from near to far; return the windows' centres.

    The lines of a lane run in parallel, so both windows of a step move together, by the paint in
    either. Windows without paint move on as before.
    """
    rows = max(1, round(_WINDOW * ALONG))
    middles = np.array(base)
    positions = np.empty((2, len(mask)))
    step = 0.0
    for end in range(len(mask), 0, -rows):
        part = np.s_[max(0, end - rows) : end]
        middles += step
        offsets = top_view.laterals - middles[:, None]
        counts = np.count_nonzero(mask[part] == PAINT, axis=0) * (np.abs(offsets) <= MARGIN)
        shift = float((counts * offsets).sum() / max(1, counts.sum()))
        middles += shift
        step += shift / 2  # damped: part of the shift may be noise
        positions[:, part] = middles[:, None]
    return positions[0], positions[1]


@dataclass(frozen=True, slots=True)
class LaneCurves:
    """Both lines of a lane: metres to the right, as second-order curves of the distance ahead."""

    bend: float
    """Half the curvature, 1/m, positive in a bend to the right."""
    heading: float
    """Slope of the lines beside the camera: metres to the right per metre ahead."""
    left: float
    """Position of the left line beside the camera, metres."""
    right: float
    """Position of the right line beside the camera, metres."""
    pitch: float
    """Tangent of the vehicle's pitch divided by the camera's height, 1/m."""

    @property
    def width(self) -> float:
        """Width of the lane, metres."""
        return self.right - self.left

    @property
    def contain_camera(self) -> bool:
        """Whether the camera is between the lines."""
        return self.left < 0 < self.right

    def at(self, z: Float64Array) -> LinePositions:
        """Return x of the left and of the right line at distances `(n,)`, as the camera sees it."""
        scale = pitch_scale(z, self.pitch)
        common = self.heading * z + self.bend * z**2 / scale
        return self.left * scale + common, self.right * scale + common


def pitch_scale(z: Float64Array, pitch: float) -> Float64Array:
    """Return how much larger than without pitch a width appears at distances `(n,)`."""
    return np.maximum(1 - pitch * z, _MIN_SCALE)


def normal_equations(left: LinePaint, right: LinePaint, guess: LaneCurves) -> Equations:
    """Return the equations that the paint of both lines gives; `guess` linearizes the pitch."""
    of_left = _rows(left, (1, 0), guess.left, guess)
    rows = np.concatenate([of_left, _rows(right, (0, 1), guess.right, guess)])
    return np.asarray(rows[:, :-1].T @ rows)


def solve(equations: Equations, width: float) -> LaneCurves:
    """Return the curves that fit best.

    With little paint, they are straight and level, and the lane is `width` metres wide.
    """
    vector = equations[:, -1] + _WIDTH_WEIGHT * width * _APART
    solution = np.linalg.solve(equations[:, :-1] + _PRIOR, vector).tolist()
    bend, heading, left, right, pitch = solution
    return LaneCurves(bend=bend, heading=heading, left=left, right=right, pitch=pitch)


def _rows(
    paint: LinePaint, side: tuple[int, int], position: float, guess: LaneCurves
) -> Float64Array:
    """Return the coefficients of the five parameters at each painted row, and its x, `(n, 6)`."""
    bend = paint.z**2 / pitch_scale(paint.z, guess.pitch)
    sides = np.tile(np.array(side, np.float64), (len(paint.z), 1))
    return np.column_stack([bend, paint.z, sides, -position * paint.z, paint.x])


@dataclass(frozen=True, slots=True)
class FrameFit:
    """Curves fitted to the paint of one frame."""

    curves: LaneCurves
    equations: Equations
    seen: tuple[bool, bool]
    """Whether the left and the right line were seen, rather than derived from the other one."""

    def with_earlier(self, earlier: "FrameFit") -> "FrameFit":
        """Return a fit to the paint of earlier frames too, without their pitch.

        The pitch of a vehicle changes from frame to frame; its position and the road do not. The
        earlier pitch is eliminated (Schur complement).
        """
        pitch_row = earlier.equations[_PITCH]
        factors = earlier.equations[:, _PITCH] / (pitch_row[_PITCH] + _PITCH_WEIGHT)
        without_pitch = earlier.equations - np.outer(factors, pitch_row)
        without_pitch[_PITCH] = without_pitch[:, _PITCH] = 0
        equations = self.equations + _MEMORY * without_pitch
        return FrameFit(solve(equations, earlier.curves.width), equations, self.seen)


def fit_near(mask: Image, top_view: TopView, last: LaneCurves) -> FrameFit | None:
    """Fit the lane near its last curves; one visible line is enough.

    None if neither is visible, or if a line has moved too far since the last frame.
    """
    fit = _fit(mask, top_view, last.at(top_view.distances), last)
    near = top_view.distances[-1:]
    moves = np.subtract(fit.curves.at(near), last.at(near))
    return fit if any(fit.seen) and (np.abs(moves) <= _JUMP).all() else None


def fit_new(mask: Image, top_view: TopView) -> FrameFit | None:
    """Find a lane by histogram and sliding windows; None unless both lines are visible."""
    base = find_base(mask, top_view)
    if base is None:
        return None
    left, right = base
    guess = LaneCurves(bend=0, heading=0, left=left, right=right, pitch=0)
    fit = _fit(mask, top_view, slide_windows(mask, top_view, base), guess)
    return fit if all(fit.seen) and fit.curves.contain_camera else None


def _fit(mask: Image, top_view: TopView, positions: LinePositions, guess: LaneCurves) -> FrameFit:
    """Fit curves to the paint near `positions`, then twice to the paint close to the last fit."""
    width = guess.width
    for margin in (MARGIN, FINE_MARGIN, FINE_MARGIN):
        left, right = paint_along(mask, top_view, positions, margin)
        equations = normal_equations(left, right, guess)
        guess = solve(equations, width)
        positions = guess.at(top_view.distances)
    if not _is_plausible(guess, top_view):
        return FrameFit(guess, equations, (False, False))
    by_left, by_right = paint_along(mask, top_view, positions, _BESIDE)
    of_left, of_right = positions
    seen = _is_seen(left, by_left, top_view, of_left), _is_seen(right, by_right, top_view, of_right)
    if seen[0] != seen[1]:  # fit again without the paint near the unseen line
        none = LinePaint(np.empty(0), np.empty(0))
        equations = normal_equations(left if seen[0] else none, right if seen[1] else none, guess)
        guess = solve(equations, width)
    return FrameFit(guess, equations, seen)


def _is_plausible(curves: LaneCurves, top_view: TopView) -> bool:
    """Check that width, parallelism and bend are those of real roads."""
    return (
        abs(curves.width - top_view.lane_width) <= WIDTH_TOLERANCE
        and abs(curves.pitch) * top_view.length * curves.width <= _CONVERGENCE
        and 2 * abs(curves.bend) * _MIN_RADIUS <= 1
    )


def _is_seen(paint: LinePaint, around: LinePaint, top_view: TopView, x: Float64Array) -> bool:
    """Check that a line has enough paint, close to its curve x `(rows,)`, and little beside it."""
    fraction = max(paint.visible, _MIN_VISIBLE)
    if len(paint.z) < fraction * _MARKING * ALONG or paint.pixels < _ALONE * around.pixels:
        return False
    distance = paint.x - np.interp(-paint.z, -top_view.distances, x)
    return float(np.sqrt(np.mean(distance**2))) <= _SCATTER


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

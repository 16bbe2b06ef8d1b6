"""The two lines of a lane as curves on the ground, fitted to the paint of a frame.

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
"""

from dataclasses import dataclass

import numpy as np

from vdet.boxes import Float64Array, Image
from vdet.lanes.paint import (
    FINE_MARGIN,
    MARGIN,
    WIDTH_TOLERANCE,
    LinePaint,
    LinePositions,
    find_base,
    paint_along,
    slide_windows,
)
from vdet.lanes.top_view import ALONG, TopView

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
"""Less of a line asks for no less paint: a little paint can be anything."""
_MARKING = 4.0
"""Shortest length of paint by which a wholly visible line is seen, metres."""
_SCATTER = 0.08
"""Largest root mean square distance of paint from its curve, metres."""
_CONVERGENCE = 1.6
"""Most that the lines converge or diverge over the top view, metres: a vehicle pitches."""
_MIN_RADIUS = 150.0
"""Smallest radius of a bend, metres."""
_JUMP = 0.35
"""Largest sideways move of a line between two frames, metres."""


@dataclass(frozen=True, slots=True)
class LaneCurves:
    """Both lines of a lane: second order in the distance ahead, metres to the right."""

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


Equations = Float64Array
"""Normal equations of a least-squares fit of `LaneCurves`, `(5, 6)`: the matrix, and the vector in
the last column."""


def add_earlier(equations: Equations, earlier: Equations, memory: float) -> Equations:
    """Add the equations of earlier frames, weighted by `memory`, without their pitch.

    The pitch of a vehicle changes from frame to frame; its position and the road do not. The
    earlier pitch is eliminated (Schur complement).
    """
    factors = earlier[:, _PITCH] / (earlier[_PITCH, _PITCH] + _PITCH_WEIGHT)
    rest = earlier - np.outer(factors, earlier[_PITCH])
    rest[_PITCH] = rest[:, _PITCH] = 0
    return equations + memory * rest


def normal_equations(left: LinePaint, right: LinePaint, guess: LaneCurves) -> Equations:
    """Return the equations that the paint of both lines gives; `guess` linearizes the pitch."""
    rows = np.concatenate(
        [_rows(left, (1, 0), guess.left, guess), _rows(right, (0, 1), guess.right, guess)]
    )
    return np.asarray(rows[:, :-1].T @ rows)


def solve(equations: Equations, width: float) -> LaneCurves:
    """Return the curves that fit best.

    With little paint, they are straight and level, and the lane is `width` metres wide.
    """
    vector = equations[:, -1] + _WIDTH_WEIGHT * width * _APART
    return LaneCurves(*np.linalg.solve(equations[:, :-1] + _PRIOR, vector).tolist())


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


def fit_near(mask: Image, top_view: TopView, last: LaneCurves) -> FrameFit | None:
    """Fit the lane near its last curves; one seen line is enough.

    None if neither is seen, or if a line has moved too far since the last frame.
    """
    fit = _fit(mask, top_view, last.at(top_view.distances), last)
    near = top_view.distances[-1:]
    moves = np.subtract(fit.curves.at(near), last.at(near))
    return fit if any(fit.seen) and (np.abs(moves) <= _JUMP).all() else None


def fit_new(mask: Image, top_view: TopView) -> FrameFit | None:
    """Find a lane by histogram and sliding windows; None unless both lines are seen."""
    base = find_base(mask, top_view)
    if base is None:
        return None
    positions = slide_windows(mask, top_view, base)
    fit = _fit(mask, top_view, positions, LaneCurves(0, 0, *base, 0))
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
    left_seen = _is_seen(left, top_view, positions[0])
    right_seen = _is_seen(right, top_view, positions[1])
    if left_seen != right_seen:  # fit again without the paint near the unseen line
        none = LinePaint(np.empty(0), np.empty(0))
        left, right = left if left_seen else none, right if right_seen else none
        equations = normal_equations(left, right, guess)
        guess = solve(equations, width)
    return FrameFit(guess, equations, (left_seen, right_seen))


def _is_plausible(curves: LaneCurves, top_view: TopView) -> bool:
    """Check width, parallel lines and bend against those of real roads."""
    return (
        abs(curves.width - top_view.lane_width) <= WIDTH_TOLERANCE
        and abs(curves.pitch) * top_view.length * curves.width <= _CONVERGENCE
        and 2 * abs(curves.bend) * _MIN_RADIUS <= 1
    )


def _is_seen(paint: LinePaint, top_view: TopView, x: Float64Array) -> bool:
    """Check that a line has enough paint, close enough to its curve x `(rows,)`."""
    fraction = max(paint.visible, _MIN_VISIBLE)
    if len(paint.z) < fraction * _MARKING * ALONG:
        return False
    distance = paint.x - np.interp(-paint.z, -top_view.distances, x)
    return float(np.sqrt(np.mean(distance**2))) <= _SCATTER

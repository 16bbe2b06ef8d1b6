"""The lane in one frame: curves fitted to its paint, and checks that they can be a lane."""

from dataclasses import dataclass

import numpy as np

from vdet.boxes import Float64Array
from vdet.config.lanes import LaneSettings
from vdet.lanes.curves import LaneCurves, NormalEquations, normal_equations, solve
from vdet.lanes.paint import (
    FINE_MARGIN,
    MARGIN,
    NO_PAINT,
    WIDTH_TOLERANCE,
    LinePaint,
    LinePositions,
    find_base,
    paint_along,
    slide_windows,
)
from vdet.lanes.top_view import ALONG, TopView
from vdet.media.images import Image

_LEAST_VISIBLE = 0.25
"""Less of a line asks for no less paint: a little paint can be anything."""
_MARKING = 4.0
"""Shortest length of paint by which a wholly visible line is seen, metres."""
_SCATTER = 0.08
"""Largest root mean square distance of paint from its curve, metres."""
_CONVERGENCE = 1.6
"""Most that the lines converge or diverge over the top view, metres: a vehicle pitches."""
_LEAST_RADIUS = 150.0
"""Smallest radius of a bend, metres."""
_JUMP = 0.35
"""Largest sideways move of a line between two frames, metres."""


@dataclass(frozen=True, slots=True)
class FrameFit:
    """Curves fitted to the paint of one frame."""

    curves: LaneCurves
    equations: NormalEquations
    seen: tuple[bool, bool]
    """Whether the left and the right line were seen, rather than derived from the other one."""


def fit_near(
    mask: Image, top_view: TopView, last: LaneCurves, settings: LaneSettings
) -> FrameFit | None:
    """Fit the lane near its last curves; one seen line is enough. None if neither is seen."""
    fit = _fit(mask, top_view, last.at(top_view.distances), last, settings)
    return fit if any(fit.seen) and _is_near(fit.curves, last, top_view) else None


def fit_new(mask: Image, top_view: TopView, settings: LaneSettings) -> FrameFit | None:
    """Find a lane by histogram and sliding windows; None unless both lines are seen."""
    base = find_base(mask, top_view, settings)
    if base is None:
        return None
    positions = slide_windows(mask, top_view, base)
    fit = _fit(mask, top_view, positions, LaneCurves(0, 0, *base, 0), settings)
    return fit if all(fit.seen) and fit.curves.contain_camera else None


def _fit(
    mask: Image,
    top_view: TopView,
    positions: LinePositions,
    guess: LaneCurves,
    settings: LaneSettings,
) -> FrameFit:
    """Fit curves to the paint near `positions`, then twice to the paint close to the last fit."""
    width = guess.width
    for margin in (MARGIN, FINE_MARGIN, FINE_MARGIN):
        left, right = (paint_along(mask, top_view, x, margin) for x in positions)
        equations = normal_equations(left, right, guess)
        guess = solve(equations, width)
        positions = guess.at(top_view.distances)
    if not _is_plausible(guess, settings):
        return FrameFit(guess, equations, (False, False))
    left_seen = _is_seen(left, top_view, positions[0])
    right_seen = _is_seen(right, top_view, positions[1])
    if left_seen != right_seen:  # fit again without the paint near the unseen line
        equations = normal_equations(
            left if left_seen else NO_PAINT, right if right_seen else NO_PAINT, guess
        )
        guess = solve(equations, width)
    return FrameFit(guess, equations, (left_seen, right_seen))


def _is_plausible(curves: LaneCurves, settings: LaneSettings) -> bool:
    """Check width, parallel lines and bend against those of real roads."""
    return (
        abs(curves.width - settings.lane_width) <= WIDTH_TOLERANCE
        and abs(curves.pitch) * settings.length * curves.width <= _CONVERGENCE
        and 2 * abs(curves.bend) * _LEAST_RADIUS <= 1
    )


def _is_seen(paint: LinePaint, top_view: TopView, x: Float64Array) -> bool:
    """Check that a line has enough paint, close enough to its curve x `(rows,)`."""
    share = max(paint.visible, _LEAST_VISIBLE)
    if len(paint.z) < share * _MARKING * ALONG:
        return False
    distance = paint.x - np.interp(-paint.z, -top_view.distances, x)
    return float(np.sqrt(np.mean(distance**2))) <= _SCATTER


def _is_near(curves: LaneCurves, last: LaneCurves, top_view: TopView) -> bool:
    """Check that neither line has moved too far since the last frame."""
    near = top_view.distances[-1:]
    moves = np.subtract(curves.at(near), last.at(near))
    return bool((np.abs(moves) <= _JUMP).all())

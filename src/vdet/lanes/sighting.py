"""The lane as one frame shows it, and whether to believe it."""

from dataclasses import dataclass

import numpy as np

from vdet.config.lanes import LaneCheckSettings, LaneSettings
from vdet.geometry import Float64Array
from vdet.lanes.curves import NONE, Curves, Paint
from vdet.lanes.fit import Evidence, gather, solve
from vdet.lanes.search import Guide, find_base, paint_along, slide_windows
from vdet.lanes.view import View
from vdet.media.images import Image


@dataclass(frozen=True, slots=True)
class Sighting:
    """Curves through a frame's paint, and which of the lines were truly seen, left and right."""

    curves: Curves
    evidence: Evidence
    seen: tuple[bool, bool]


def sight_around(mask: Image, view: View, last: Curves, settings: LaneSettings) -> Sighting | None:
    """Look for the lane around its last curves; one line may do. None where it is not seen."""
    sighting = _sight(mask, view, last.at(view.distances), last, settings)
    return sighting if any(sighting.seen) and _is_near(sighting, last, view, settings) else None


def sight_anew(mask: Image, view: View, settings: LaneSettings) -> Sighting | None:
    """Look for the lane by histogram and sliding windows; both lines must be seen, else None."""
    base = find_base(mask, view, settings)
    if base is None:
        return None
    guide = slide_windows(mask, view, base, settings)
    sighting = _sight(mask, view, guide, Curves(0, 0, *base, 0), settings)
    return sighting if all(sighting.seen) and sighting.curves.hold_camera else None


def _sight(
    mask: Image, view: View, guide: Guide, guess: Curves, settings: LaneSettings
) -> Sighting:
    """Fit curves to the paint along a guide, then twice to the paint close to these curves."""
    search, width = settings.search, guess.width
    for margin in (search.margin, search.fine_margin, search.fine_margin):
        left, right = (paint_along(mask, view, x, margin) for x in guide)
        evidence = gather(left, right, guess)
        guess = solve(evidence, width)
        guide = guess.at(view.distances)
    if not _is_plausible(guess, settings):
        return Sighting(guess, evidence, (False, False))
    left_seen = _is_seen(left, view, guide[0], settings.check)
    right_seen = _is_seen(right, view, guide[1], settings.check)
    if left_seen != right_seen:  # what lies about the other line is not its paint
        evidence = gather(left if left_seen else NONE, right if right_seen else NONE, guess)
        guess = solve(evidence, width)
    return Sighting(guess, evidence, (left_seen, right_seen))


def _is_plausible(curves: Curves, settings: LaneSettings) -> bool:
    """Tell whether roads have such lanes: width, lines parallel, bend."""
    check, road = settings.check, settings.view
    return (
        abs(curves.width - road.lane_width) <= check.width
        and abs(curves.pitch) * road.length * curves.width <= check.parallel
        and 2 * abs(curves.bend) * check.radius <= 1
    )


def _is_seen(paint: Paint, view: View, x: Float64Array, check: LaneCheckSettings) -> bool:
    """Tell whether there is paint enough of a line, and in line with x `(rows,)`, its curve."""
    if len(paint.z) < check.marking * view.along:
        return False
    distance = paint.x - np.interp(-paint.z, -view.distances, x)
    return float(np.sqrt(np.mean(distance**2))) <= check.scatter


def _is_near(sighting: Sighting, last: Curves, view: View, settings: LaneSettings) -> bool:
    """Tell whether both lines are where they can have come to since the last frame."""
    near = view.distances[-1:]
    moves = np.subtract(sighting.curves.at(near), last.at(near))
    return bool((np.abs(moves) <= settings.check.jump).all())

"""The lane in one frame, and its JSON form."""

from dataclasses import dataclass
from typing import Any

from vdet.boxes import Float64Array


@dataclass(frozen=True, slots=True)
class Lane:
    """The lane that the camera is in: its shape in metres, its two lines in pixels.

    The lines are in the undistorted frame, `(n, 2)` as `x, y`, and begin at the nearest point.
    """

    curvature: float
    """1/m, positive in a bend to the right; smoothed over more frames than the lines."""
    radius: float | None
    """Radius of the bend, metres; None if the road is straight (5000 m or more)."""
    offset: float
    """Distance of the camera from the middle of the lane, metres; positive: it is to the right."""
    width: float
    """Width of the lane, metres."""
    left: Float64Array
    right: Float64Array


def lane_record(lane: Lane | None) -> dict[str, Any] | None:
    """Return a lane as plain values for JSON; None if there is none.

    `radius` (None on a straight road), `offset` and `width` are metres, rounded to millimetres.
    `left` and `right` are `[[x, y], …]`, pixels, rounded to tenths. All mean the same as in `Lane`.
    """
    if lane is None:
        return None
    return {
        "radius": None if lane.radius is None else round(lane.radius, 3),
        "offset": round(lane.offset, 3),
        "width": round(lane.width, 3),
        "left": _points(lane.left),
        "right": _points(lane.right),
    }


def _points(line: Float64Array) -> list[list[float]]:
    return [[round(x, 1), round(y, 1)] for x, y in line.tolist()]

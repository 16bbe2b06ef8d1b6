"""Where a vehicle is on the road: from the pixel at which it stands to metres and a lane.

The ground is taken as flat. A pixel on it shows the ground point with the distance z of the top
view, and 1 / z grows with every row below the horizon by the same amount. A camera that pitches by
a little moves all rows by the same amount, so with the fitted `pitch` the true distance Z is::

    1 / Z = 1 / z - pitch

Z is 0 below the camera's lens, not at the front of the vehicle that carries it. The lines of the
lane are known in the same coordinates (see `curves`). Lanes beside the own one are taken to be as
wide as it is, and to follow the same curve.
"""

import math
from dataclasses import dataclass

from vdet.lanes.curves import LaneCurves
from vdet.lanes.top_view import TopView

_REACH = 1.25
"""Farthest reported vehicle, as a multiple of the distance up to which the lane is fitted."""
_ROW = 0.1
"""Largest relative error of a distance for an error of one row: more is near the horizon."""
_LANES = 3
"""Number of lanes to each side of the own one that are reported."""


@dataclass(frozen=True, slots=True)
class RoadPosition:
    """The place of a point on the road."""

    distance: float
    """Metres along the road from below the camera's lens."""
    lateral: float
    """Metres from the middle of the own lane, along the curve of the road; positive: right."""
    lane: int | None
    """0 for the own lane, 1 for the next one to the right, -1 to the left and so on; None for one
    that is too far to the side."""


def position_on_road(
    foot: tuple[float, float], curves: LaneCurves, top_view: TopView
) -> RoadPosition | None:
    """Return where on the road a point is that a pixel of the undistorted frame shows.

    `foot` is `(x, y)`; whole numbers are pixel centres. None if it is above or near the horizon, or
    farther than the lane is known.
    """
    x, y = foot
    slope, nearness = top_view.sight(foot)
    _, below = top_view.sight((x, y + 1))
    nearness, row = nearness - curves.pitch, below - nearness
    farthest = _REACH * float(top_view.distances[0])
    if not (nearness * farthest >= 1 and row <= _ROW * nearness):  # NaN too is not known
        return None
    distance = 1 / nearness
    shift = curves.heading * distance + curves.bend * distance**2  # of all lines, at the distance
    from_left = slope * distance - shift - curves.left
    lane = math.floor(from_left / curves.width)
    return RoadPosition(
        distance=distance,
        lateral=from_left - curves.width / 2,
        lane=lane if abs(lane) <= _LANES else None,
    )

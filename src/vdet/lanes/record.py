"""A lane as JSON has it."""

from typing import Any

from vdet.lanes.lane import Lane, Polyline


def lane_record(lane: Lane | None) -> dict[str, Any] | None:
    """Return `radius`, `offset` and `width` in metres, `left` and `right` as `[[x, y], …]`.

    `radius` is None on a straight road; `offset` is positive where the camera is to the right of
    the lane's middle. The lines are pixels of the undistorted frame, the nearest point first. None
    where no lane is shown. Metres are rounded to millimetres, pixels to tenths.
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


def _points(line: Polyline) -> list[list[float]]:
    return [[round(x, 1), round(y, 1)] for x, y in line.tolist()]

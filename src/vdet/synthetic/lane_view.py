"""The view of the lane finder that fits the camera of a scene."""

from vdet.config.lanes import LaneSettings
from vdet.synthetic.camera import PinholeCamera


def lane_view(
    camera: PinholeCamera, *, near: float, far: float, width: float = 3.7
) -> LaneSettings:
    """Return the settings that show the road from `near` to `far` metres ahead of the camera.

    The camera is in the middle of a lane that is `width` metres wide; it sees the road at `near`.
    """
    return LaneSettings(
        top=_row(camera, far),
        bottom=_row(camera, near),
        top_left=_column(camera, -width / 2, far),
        top_right=_column(camera, width / 2, far),
        bottom_left=_column(camera, -width / 2, near),
        bottom_right=_column(camera, width / 2, near),
        lane_width=width,
        length=far - near,
    )


def _row(camera: PinholeCamera, distance: float) -> float:
    """Return the row of the road at a distance, share of the frame's height."""
    return (camera.horizon + camera.focal * camera.above_ground / distance) / camera.height


def _column(camera: PinholeCamera, lateral: float, distance: float) -> float:
    """Return the column of a point of a straight road, share of the frame's width."""
    return 0.5 + camera.focal * lateral / distance / camera.width

"""The section `lanes`: how the camera sees the road."""

from pydantic import Field, model_validator

from vdet.config.section import Section, Share


class LaneSettings(Section):
    """The road in front of the camera: a trapezoid whose sides are the lines of a straight lane.

    For another camera, take an undistorted frame of a straight and level road. Choose two rows:
    the nearer one above the bonnet, the farther one a little below the horizon. Note the columns
    at which the lines of the vehicle's lane cross them.
    """

    top: Share = 0.63
    """Farther row, as a share of the frame's height."""
    bottom: Share = 0.93
    """Nearer row, as a share of the frame's height."""
    top_left: float = Field(0.4602, ge=-2, le=3)
    """Column of the left line in the farther row, as a share of the frame's width."""
    top_right: float = Field(0.5382, ge=-2, le=3)
    """Column of the right line in the farther row."""
    bottom_left: float = Field(0.2086, ge=-2, le=3)
    """Column of the left line in the nearer row."""
    bottom_right: float = Field(0.7898, ge=-2, le=3)
    """Column of the right line in the nearer row."""
    lane_width: float = Field(3.7, gt=0, le=20)
    """Width of the lane in metres."""
    length: float = Field(37.0, gt=1, le=200)
    """Distance between the two rows on the road, in metres. Measure it by dashes of known length,
    or compute focal length × lane_width × (1 / lane width in the farther row − 1 / lane width in
    the nearer row), all but lane_width in pixels.
    """

    @model_validator(mode="after")
    def _is_a_trapezoid(self) -> "LaneSettings":
        if self.bottom <= self.top:
            raise ValueError("bottom must be below top, a larger share of the height")
        far, near = self.top_right - self.top_left, self.bottom_right - self.bottom_left
        if not 0 < far < 0.9 * near:
            raise ValueError("the lines must be closer together at top than at bottom")
        return self

"""Settings of the lane finder. Places in the frame are shares of its size, so any size works."""

from pydantic import Field, model_validator

from vdet.config.section import Section, Share

_MAX_PIXELS = 4_000_000  # of the top view


class TopViewSettings(Section):
    """The road that is seen from above: a trapezoid in the frame, its sides on straight lane lines.

    For another camera, take an undistorted frame of a straight and level road. Choose two rows:
    the nearer one above the bonnet, the farther one a little below the horizon. Note the columns
    at which the lines of the vehicle's lane cross them.
    """

    top: Share = Field(
        0.63, description="farther row of the trapezoid, share of the frame's height"
    )
    bottom: Share = Field(
        0.93, description="nearer row of the trapezoid, share of the frame's height"
    )
    top_left: float = Field(
        0.4602, ge=-2, le=3, description="column of the left line in the farther row, share of the "
        "frame's width"
    )  # fmt: skip
    top_right: float = Field(
        0.5382, ge=-2, le=3, description="column of the right line in the farther row"
    )
    bottom_left: float = Field(
        0.2086, ge=-2, le=3, description="column of the left line in the nearer row"
    )
    bottom_right: float = Field(
        0.7898, ge=-2, le=3, description="column of the right line in the nearer row"
    )
    lane_width: float = Field(3.7, gt=0, le=20, description="width of the lane, metres")
    length: float = Field(
        37.0, gt=1, le=500, description="distance on the road between the two rows, metres; "
        "measure it by dashes of known length, or compute focal length × lane_width × (1 / lane "
        "width in the farther row − 1 / lane width in the nearer row), all but lane_width in pixels"
    )  # fmt: skip
    margin: float = Field(
        3.0, ge=0, le=50, description="road shown on each side of the lane, metres"
    )
    across: float = Field(
        30.0, ge=5, le=200, description="resolution across the road, pixels per metre"
    )
    along: float = Field(
        8.0, ge=1, le=50, description="resolution along the road, pixels per metre"
    )

    @model_validator(mode="after")
    def _check_trapezoid(self) -> "TopViewSettings":
        if self.bottom <= self.top:
            raise ValueError("bottom must be below top, a larger share of the height")
        far, near = self.top_right - self.top_left, self.bottom_right - self.bottom_left
        if not 0 < far < 0.9 * near:
            raise ValueError("the lines must be closer together at top than at bottom")
        across = (self.lane_width + 2 * self.margin) * self.across
        if across * self.length * self.along > _MAX_PIXELS:
            raise ValueError(f"across and along must not give more than {_MAX_PIXELS} pixels")
        return self


class MaskSettings(Section):
    """Which pixels are paint: lighter or yellower than the road on both sides of them."""

    line_width: float = Field(0.15, gt=0, le=1, description="width of a painted line, metres")
    reach: float = Field(
        0.35, gt=0, le=3, description="distance at which a pixel is compared with the road on its "
        "left and right, metres"
    )  # fmt: skip
    lightness: Share = Field(
        0.10, description="smallest rise in lightness from the road to paint, share of the road's "
        "lightness"
    )  # fmt: skip
    least_lightness: float = Field(
        10.0, ge=0, le=255, description="smallest rise in lightness from the road to paint, on a "
        "scale of 0 to 255"
    )  # fmt: skip
    yellow: float = Field(
        9.0, ge=0, le=255, description="smallest rise in the b channel of CIELAB from the road to "
        "yellow paint, on a scale of 0 to 255; yellow paint need not be lighter"
    )  # fmt: skip


class LaneSearchSettings(Section):
    """Where the painted pixels of the two lines are searched."""

    base: float = Field(
        15.0, gt=0, le=200, description="length of the nearest part of the road, which the "
        "histogram covers, metres"
    )  # fmt: skip
    window: float = Field(3.0, gt=0, le=50, description="length of a sliding window, metres")
    margin: float = Field(
        0.5, gt=0, le=3, description="largest distance of paint from the middle of its window or "
        "from the last frame's curve, metres"
    )  # fmt: skip
    fine_margin: float = Field(
        0.2, gt=0, le=3, description="largest distance of paint from a curve that was fitted to "
        "this frame, metres"
    )  # fmt: skip


class LaneCheckSettings(Section):
    """Conditions that curves must meet to count as a lane."""

    width: float = Field(
        0.6, gt=0, le=5, description="largest difference between the width and view.lane_width, "
        "metres"
    )  # fmt: skip
    parallel: float = Field(
        1.6, gt=0, le=5, description="how much the lines may converge or diverge over view.length, "
        "metres; they do so when the vehicle pitches"
    )  # fmt: skip
    radius: float = Field(150.0, gt=0, description="smallest radius of a bend, metres")
    marking: float = Field(
        4.0, gt=0, description="shortest length of paint by which a line is seen, metres; less in "
        "proportion where vehicles hide a part of it"
    )  # fmt: skip
    scatter: float = Field(
        0.08, gt=0, le=1, description="largest root mean square distance of paint from its curve, "
        "metres"
    )  # fmt: skip
    jump: float = Field(
        0.35, gt=0, le=5, description="largest sideways move of a line between two frames, metres"
    )


class LaneTrackSettings(Section):
    """How the curves of consecutive frames become one lane."""

    memory: float = Field(
        0.6, ge=0, lt=1, description="weight of the frames before, if the newest frame has weight 1"
    )
    curve_memory: float = Field(
        0.95, ge=0, lt=1, description="share of the frames before in the radius that is shown"
    )
    carry: int = Field(
        12, ge=0, le=1000, description="number of frames for which an unseen line is kept"
    )
    straight: float = Field(
        5000.0, gt=0, description="radius from which the road counts as straight, metres"
    )


class PlaceSettings(Section):
    """Of which vehicles the distance and the lane are told."""

    reach: float = Field(
        1.25, ge=0.1, le=3, description="farthest vehicle, as a multiple of the distance of "
        "view.top, up to which the lane is fitted"
    )  # fmt: skip
    row: float = Field(
        0.1, gt=0, le=1, description="largest error of the distance, share of it, that one row of "
        "pixels makes; beyond it, near the horizon, the distance is not told"
    )  # fmt: skip
    edge: Share = Field(
        0.005, description="a box that ends this near to the left, right or lower edge of the "
        "frame, as a share of the frame, is cut off: its distance is not told"
    )  # fmt: skip
    lanes: int = Field(
        3, ge=0, le=20, description="number of lanes to each side of the own one that are told"
    )  # fmt: skip


class LaneSettings(Section):
    """Finding the lane: top view, paint, search, checks, smoothing; the place of vehicles."""

    view: TopViewSettings = TopViewSettings()
    mask: MaskSettings = MaskSettings()
    search: LaneSearchSettings = LaneSearchSettings()
    check: LaneCheckSettings = LaneCheckSettings()
    track: LaneTrackSettings = LaneTrackSettings()
    place: PlaceSettings = PlaceSettings()

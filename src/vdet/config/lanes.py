"""Settings of the lane finder. Places in the frame are fractions of it, so any size works."""

from pydantic import Field, model_validator

from vdet.config.section import Fraction, Section

_MAX_PIXELS = 4_000_000  # of the view from above


class ViewSettings(Section):
    """The stretch of road that is seen from above: a trapezoid on straight lane lines.

    For another camera: take an undistorted frame of a straight and level road, choose two rows,
    and note where the lines of the vehicle's lane cross them; the nearer row above the bonnet,
    the farther one a little below the horizon.
    """

    top: Fraction = Field(0.63, description="farther row of the trapezoid, share of the height")
    bottom: Fraction = Field(0.93, description="nearer row")
    top_left: float = Field(
        0.4602, ge=-2, le=3, description="where the lane's left line crosses the farther row, "
        "share of the width"
    )  # fmt: skip
    top_right: float = Field(0.5382, ge=-2, le=3, description="where the right line does")
    bottom_left: float = Field(0.2086, ge=-2, le=3, description="the left line, nearer row")
    bottom_right: float = Field(0.7898, ge=-2, le=3, description="the right line, nearer row")
    lane_width: float = Field(3.7, gt=0, le=20, description="metres between these lines")
    length: float = Field(
        37.0, gt=1, le=500, description="metres between the two rows, by dashes of known length or "
        "as focal length in pixels × lane_width × (1 / width at top − 1 / width at bottom, pixels)"
    )  # fmt: skip
    margin: float = Field(3.0, ge=0, le=50, description="metres seen on both sides of the lane")
    across: float = Field(30.0, ge=5, le=200, description="pixels a metre across the road")
    along: float = Field(8.0, ge=1, le=50, description="pixels a metre along it")

    @model_validator(mode="after")
    def _is_a_trapezoid(self) -> "ViewSettings":
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

    line_width: float = Field(0.15, gt=0, le=1, description="of a painted line, metres")
    reach: float = Field(
        0.35, gt=0, le=3, description="how far to either side the road is looked at, metres"
    )
    lightness: Fraction = Field(
        0.10, description="a line is lighter than the road by this share of the road's lightness"
    )
    least_lightness: float = Field(
        10.0, ge=0, le=255, description="and by so many of 255 levels of lightness at least"
    )
    yellow: float = Field(
        9.0, ge=0, le=255, description="or yellower by so many levels of Lab's b channel"
    )


class LaneSearchSettings(Section):
    """Where the pixels of the lane's two lines are looked for."""

    base: float = Field(
        15.0, gt=0, le=200, description="metres, nearest ones, of which the histogram is taken"
    )
    window: float = Field(3.0, gt=0, le=50, description="length of a sliding window, metres")
    margin: float = Field(
        0.5, gt=0, le=3, description="to either side of a window's middle or of the last fit, m"
    )
    fine_margin: float = Field(0.2, gt=0, le=3, description="the same around a first fit, metres")


class LaneCheckSettings(Section):
    """What a lane must look like to be believed."""

    width: float = Field(0.6, gt=0, le=5, description="its width may differ from lane_width, m")
    parallel: float = Field(
        1.6, gt=0, le=5, description="its lines may run apart or together over the view, metres "
        "(a car that pitches sees them so)"
    )  # fmt: skip
    radius: float = Field(150.0, gt=0, description="bends are no tighter than this, metres")
    marking: float = Field(4.0, gt=0, description="metres of paint seen, each line")
    scatter: float = Field(
        0.08, gt=0, le=1, description="root mean square of the paint's distance to the fit, metres"
    )
    jump: float = Field(
        0.35, gt=0, le=5, description="a line may move from frame to frame by this, metres"
    )


class LaneTrackSettings(Section):
    """How fits of consecutive frames become one lane."""

    memory: float = Field(
        0.6, ge=0, lt=1, description="weight of the frames before against this one's, each frame"
    )
    curve_memory: float = Field(0.95, ge=0, lt=1, description="the same for the radius shown")
    carry: int = Field(12, ge=0, le=1000, description="frames that an unseen line is kept for")
    straight: float = Field(5000.0, gt=0, description="radius from which on a road is straight, m")


class LaneSettings(Section):
    """The lane finder: view from above, paint, search, checks, smoothing."""

    view: ViewSettings = ViewSettings()
    mask: MaskSettings = MaskSettings()
    search: LaneSearchSettings = LaneSearchSettings()
    check: LaneCheckSettings = LaneCheckSettings()
    track: LaneTrackSettings = LaneTrackSettings()

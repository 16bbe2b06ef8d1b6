"""How the detections of consecutive frames become tracks: one class a kind."""

from typing import Annotated, Literal

from pydantic import Field

from vdet.config.section import Pixels, Section, Share

Seconds = Annotated[float, Field(ge=0, le=1000)]
Positive = Annotated[float, Field(gt=0, le=1000)]


class TrackerSettings(Section):
    """How detections become tracks. Each kind has a class of its own."""

    kind: str


class MotionTrackerSettings(TrackerSettings):
    """The motion tracker (`vdet.track.motion` explains it); times are seconds."""

    kind: Literal["motion"] = Field(
        "motion",
        description="motion: vehicles move steadily, also while they are hidden or not detected; "
        "rules: the rules of the original system, which count frames",
    )
    smallest: Share = Field(
        0.028, description="narrower vehicles are not shown, share of the frame's width"
    )
    least_score: Share = Field(
        0.4, description="vehicles whose latest detections have a lower mean score are not shown"
    )
    needed: Seconds = Field(
        0.1, description="evidence before a vehicle is shown: seconds of detections with score 1"
    )
    leak: Share = Field(
        0.2,
        description="evidence that a vehicle loses in a second; detections with lower scores never "
        "add up",
    )
    noise: Positive = Field(
        0.1,
        description="standard deviation of the sides of a detection with score 1, share of the "
        "vehicle's own size",
    )
    acceleration: Positive = Field(
        1.0,
        description="standard deviation by which a vehicle's velocity changes in a second, sizes "
        "of the vehicle a second",
    )
    velocity: Positive = Field(
        2.5, description="standard deviation of a new vehicle's velocity, sizes a second"
    )
    overlap: Share = Field(
        0.3,
        description="least intersection over union of a detection with the box where its vehicle "
        "is expected",
    )
    part: Share = Field(
        0.6,
        description="a detection with more than this share inside a shown vehicle is a part of it",
    )
    hidden: Share = Field(
        0.5, description="a vehicle is hidden where a nearer one covers more than this share of it"
    )
    carried: Seconds = Field(
        0.35, description="a vehicle that is not detected is shown by prediction for this long"
    )
    remembered: Seconds = Field(
        1.0, description="a vehicle that is not detected keeps its id for this long"
    )
    remembered_hidden: Seconds = Field(5.0, description="the same behind another vehicle")


class RulesTrackerSettings(TrackerSettings):
    """The rules of the original system (`vdet.track.rules` lists them); times are frames."""

    kind: Literal["rules"] = Field("rules", description="motion or rules")
    reference_height: int = Field(
        720,
        ge=16,
        le=100_000,
        description="lengths in frame pixels below are for a frame with this many rows; for "
        "another frame they are multiplied by rows / reference_height and rounded",
    )
    history: int = Field(
        10, ge=1, le=1000, description="detections that a car's box is averaged over"
    )
    min_region: Pixels = Field(50, description="regions narrower or lower than this are ignored")
    near: Pixels = Field(50, description="a region within this distance of a car is close to it")
    confident_peak: float = Field(
        2.0, ge=0, description="a region with a higher peak is trusted sooner"
    )
    detections_needed: int = Field(10, ge=1, description="in a row, before a car is shown")
    confident_detections_needed: int = Field(
        3, ge=1, description="the same, after a confident peak"
    )
    wide: Pixels = Field(
        200, description="a region wider than this is always good enough for its car"
    )
    good_fraction: Share = Field(2 / 3, description="so is one wider than this share of its car")
    max_combined: Pixels = Field(
        250, description="two regions of one car, combined, must be narrower"
    )
    combined_tolerance: Share = Field(
        1 / 3, description="and differ in width from the car by no more than this share of it"
    )
    merge_overlap: Pixels = Field(
        40, description="cars in one region that overlap by more, across and down, become one"
    )
    match_distance: Pixels = Field(
        50, description="a car's image is searched this far from its last place"
    )
    match_method: Literal["ccoeff_normed", "ccorr_normed", "sqdiff_normed"] = Field(
        "ccoeff_normed", description="score of the template match, as cv2.matchTemplate names it"
    )
    match_score: Share = Field(
        0.5, description="least score of a match; 1 is perfect (sqdiff_normed is inverted)"
    )
    young: int = Field(
        7, ge=0, description="a car with fewer detections is deleted at its first miss"
    )
    max_matches: int = Field(
        12, ge=1, description="a car is deleted after this many matches in a row"
    )
    max_misses: int = Field(5, ge=1, description="a car is deleted after this many misses in a row")

"""How regions become vehicles that are followed."""

from typing import Annotated, Literal

from pydantic import Field

from vdet.config.section import Fraction, Pixels, Section

Frames = Annotated[int, Field(ge=0, le=100_000)]
Positive = Annotated[float, Field(gt=0, le=1000)]


class MotionSettings(Section):
    """The motion tracker (`tracking.motion` explains it); lengths are shares, not pixels."""

    smallest: Fraction = Field(
        0.028, description="narrower vehicles are not shown, share of the frame's width"
    )
    strong: Positive = Field(
        0.7, description="evidence (a region's peak) of a vehicle that is seen clearly"
    )
    still: Fraction = Field(
        0.6, description="a single picture shows vehicles of at least this share of strong"
    )
    leak: Fraction = Field(
        0.2, description="evidence that every vehicle loses in a frame, share of strong"
    )
    needed: Positive = Field(
        2.5, description="evidence gathered before a vehicle is shown, in strong frames"
    )
    noise: Positive = Field(
        0.1,
        description="standard deviation of a clear region's place and size, share of the "
        "vehicle's own size",
    )
    acceleration: Positive = Field(
        0.01, description="of the change of a vehicle's velocity from frame to frame, the same"
    )
    velocity: Positive = Field(0.1, description="of a new vehicle's velocity, the same a frame")
    overlap: Fraction = Field(
        0.3,
        description="intersection over union of a region with where its vehicle is expected, at "
        "least",
    )
    same: Fraction = Field(
        0.6, description="a region or a new vehicle that lies so far in a shown one is a part of it"
    )
    hidden: Fraction = Field(
        0.5, description="a vehicle is hidden where a nearer one covers more than this share of it"
    )
    carried: Frames = Field(
        8, description="frames for which a vehicle is shown without a region, by prediction"
    )
    remembered: Frames = Field(
        25, description="frames for which it is remembered, so that it keeps its id"
    )
    remembered_hidden: Frames = Field(125, description="the same behind another vehicle")


class TrackerSettings(Section):
    """How regions become vehicles that are followed (`tracking` explains it)."""

    method: Literal["motion", "rules"] = Field(
        "motion",
        description="motion: vehicles move steadily, also unseen and hidden ones, by the settings "
        "under motion; rules: the original's, by those from here on",
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
    good_fraction: Fraction = Field(2 / 3, description="so is one wider than this share of its car")
    max_combined: Pixels = Field(
        250, description="two regions of one car, combined, must be narrower"
    )
    combined_tolerance: Fraction = Field(
        1 / 3, description="and differ in width from the car by no more than this share of it"
    )
    merge_overlap: Pixels = Field(
        40, description="cars in one region that overlap by more, across and down, become one"
    )
    match_distance: Pixels = Field(50, description="a car is looked for this far from where it was")
    match_method: Literal["ccoeff_normed", "ccorr_normed", "sqdiff_normed"] = Field(
        "ccoeff_normed", description="score of the template match, as cv2.matchTemplate names it"
    )
    match_score: Fraction = Field(
        0.5, description="a match must score this; 1 is perfect (sqdiff_normed is turned round)"
    )
    young: int = Field(
        7, ge=0, description="a car with fewer detections is deleted at its first miss"
    )
    max_matches: int = Field(
        12, ge=1, description="so is one whose last detections all were matches"
    )
    max_misses: int = Field(5, ge=1, description="so is one missed in this many frames in a row")
    motion: MotionSettings = MotionSettings()

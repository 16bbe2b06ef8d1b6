"""The section `tracker`: how the detections of consecutive frames become tracks."""

from typing import Annotated, Literal

from pydantic import Field

from vdet.config.section import Pixels, Section, Share

Seconds = Annotated[float, Field(ge=0, le=1000)]


class TrackerSettings(Section):
    """How detections become tracks. Each kind has a class of its own."""

    kind: str


class MotionTrackerSettings(TrackerSettings):
    """The motion tracker (`vdet.track.motion` explains it); times are in seconds."""

    kind: Literal["motion"] = Field(
        "motion",
        description="motion: vehicles move steadily, also while they are hidden or not detected. "
        "rules: the rules of the original system, which count frames.",
    )
    smallest: Share = Field(
        0.028, description="Least width of a vehicle that is shown, as a share of the frame's."
    )
    least_score: Share = Field(
        0.4, description="Least mean score of the latest detections of a vehicle that is shown."
    )
    needed: Seconds = Field(
        0.1, description="Evidence before a vehicle is shown: seconds of detections with score 1."
    )
    leak: Share = Field(
        0.2,
        description="Evidence that a vehicle loses in a second. Detections with lower scores never "
        "add up.",
    )
    carried: Seconds = Field(
        0.35, description="Show a vehicle that is not detected for this long, by prediction."
    )
    remembered: Seconds = Field(
        1.0, description="Keep the id of a vehicle that is not detected for this long."
    )
    remembered_hidden: Seconds = Field(
        5.0, description="Keep the id of a vehicle hidden behind another one for this long."
    )


class RulesTrackerSettings(TrackerSettings):
    """The rules of the original system (`vdet.track.rules` lists them); times are in frames."""

    kind: Literal["rules"] = Field("rules", description="motion or rules.")
    history: int = Field(
        10, ge=1, le=1000, description="Number of detections that a car's box is averaged over."
    )
    min_region: Pixels = Field(50, description="Ignore regions narrower or lower than this.")
    near: Pixels = Field(50, description="Largest distance of a region that is close to a car.")
    confident_peak: float = Field(
        2.0, ge=0, description="A region with a higher peak is trusted sooner."
    )
    detections_needed: int = Field(
        10, ge=1, description="Detections in a row before a car is shown."
    )
    confident_detections_needed: int = Field(
        3, ge=1, description="Detections in a row before a car is shown, after a confident peak."
    )
    wide: Pixels = Field(200, description="A wider region is always good enough for its car.")
    good_fraction: Share = Field(
        2 / 3, description="So is a region wider than this share of its car."
    )
    max_combined: Pixels = Field(
        250, description="Two regions of one car, combined, must be narrower than this."
    )
    combined_tolerance: Share = Field(
        1 / 3, description="Their width may differ from the car's by this share of it."
    )
    merge_overlap: Pixels = Field(
        40, description="Cars in one region that overlap by more, across and down, become one."
    )
    match_distance: Pixels = Field(
        50, description="Largest distance from its last place at which a car's image is searched."
    )
    match_score: Share = Field(0.5, description="Least score of a match; 1 is perfect.")
    young: int = Field(
        7, ge=0, description="A car with fewer detections is deleted at its first miss."
    )
    max_matches: int = Field(
        12, ge=1, description="A car is deleted after this many matches in a row."
    )
    max_misses: int = Field(
        5,
        ge=1,
        description="A car is deleted after this many misses in a row.",
    )

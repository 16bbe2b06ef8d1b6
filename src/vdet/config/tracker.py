"""The section `tracker`: how the detections of consecutive frames become tracks."""

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from vdet.config.section import Pixels, Ratio, Section

Seconds = Annotated[float, Field(ge=0, le=1000)]
LookAhead = Annotated[float, Field(ge=0, le=10)]


class TrackerSettings(Section):
    """How detections become tracks. Each kind has a class of its own."""

    kind: str
    look_ahead: LookAhead = 0.0
    """Seconds of video to search ahead of a frame before it is shown, so that vehicles are shown
    from their first detection to their last. 0: show frames at once.
    """
    min_score_standing: Ratio = 0.6
    """Before a fixed camera: minimum score of a vehicle that has not moved to be shown."""


class MotionTrackerSettings(TrackerSettings):
    """The motion tracker (`vdet.track.motion` explains it); times are in seconds."""

    kind: Literal["motion"] = "motion"
    """motion: assume steady motion, also while a vehicle is hidden or not detected. rules: the
    rules of the original system, which count frames.
    """
    look_ahead: LookAhead = 0.6
    min_size: Ratio = 0.018
    """Minimum size of a vehicle to be shown: √(width × height), as a fraction of the frame's width.
    At 0.018, a car seen from behind is 2 % of the frame wide.
    """
    min_score: Ratio = 0.4
    """Minimum mean score of a vehicle's latest detections to be shown. Values below
    detector.min_score have no effect. See min_score_standing.
    """
    confirm_seconds: Seconds = 0.1
    """Evidence needed to show a vehicle: seconds of detections with score 1."""
    decay: Ratio = 0.2
    """Evidence that a vehicle loses per second. Detections with lower scores never add up."""
    coast_seconds: Seconds = 0.35
    """Seconds to show a vehicle without detections, by prediction."""
    keep_id_seconds: Seconds = 1.0
    """Seconds to keep the id of a vehicle without detections."""
    keep_hidden_id_seconds: Seconds = 5.0
    """Seconds to keep the id of a vehicle hidden behind another."""


class RulesTrackerSettings(TrackerSettings):
    """The rules of the original system (`vdet.track.rules` lists them); times are in frames."""

    renamed: ClassVar[Mapping[str, str]] = {
        "near": "max_distance", "wide": "accepted_width", "young": "detections_to_keep",
    }  # fmt: skip

    kind: Literal["rules"] = "rules"
    """motion or rules."""
    history: int = Field(10, ge=1, le=1000)
    """Number of detections to average for a car's box."""
    min_region: Pixels = 50
    """Ignore detections narrower or lower than this."""
    max_distance: Pixels = 50
    """Maximum distance of a detection from its car."""
    confident_peak: float = Field(2.0, ge=0)
    """Heat above which a peak is confident, and its car is shown earlier."""
    detections_needed: int = Field(10, ge=1)
    """Consecutive detections needed to show a car."""
    confident_detections_needed: int = Field(3, ge=1)
    """Consecutive detections needed to show a car after a confident peak."""
    accepted_width: Pixels = 200
    """A wider detection is always accepted for its car."""
    good_fraction: Ratio = 2 / 3
    """A detection wider than this fraction of its car is also accepted."""
    max_combined: Pixels = 250
    """Maximum width of two combined detections of one car."""
    combined_tolerance: Ratio = 1 / 3
    """Maximum difference between the combined and the car's width, as a fraction of the car's
    width."""
    merge_overlap: Pixels = 40
    """Cars in one detection merge if they overlap by more, horizontally and vertically."""
    match_distance: Pixels = 50
    """Maximum distance from a car's last position to search its image."""
    match_score: Ratio = 0.5
    """Minimum score of a match; 1 is perfect."""
    detections_to_keep: int = Field(7, ge=0)
    """Minimum detections to keep a car at its first miss."""
    max_matches: int = Field(12, ge=1)
    """Consecutive matches after which a car is deleted."""
    max_misses: int = Field(5, ge=1)
    """Consecutive misses after which a car is deleted."""

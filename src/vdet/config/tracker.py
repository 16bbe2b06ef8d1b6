"""The section `tracker`: how the detections of consecutive frames become tracks."""

from typing import Annotated, Literal

from pydantic import Field

from vdet.config.section import Pixels, Section, Share

Seconds = Annotated[float, Field(ge=0, le=1000)]
LookAhead = Annotated[float, Field(ge=0, le=10)]


class TrackerSettings(Section):
    """How detections become tracks. Each kind has a class of its own."""

    kind: str
    look_ahead: LookAhead = 0.0
    """Search this many seconds of video ahead before a frame is shown. Vehicles are then shown from
    their first detection to their last. 0: show frames at once.
    """


class MotionTrackerSettings(TrackerSettings):
    """The motion tracker (`vdet.track.motion` explains it); times are in seconds."""

    kind: Literal["motion"] = "motion"
    """motion: vehicles move steadily, also while they are hidden or not detected. rules: the rules
    of the original system, which count frames.
    """
    look_ahead: LookAhead = 0.6
    min_size: Share = 0.018
    """Minimum size of a vehicle that is shown: √(width × height), as a fraction of the frame's
    width. A car seen from behind is then 2 % of the frame wide.
    """
    min_score: Share = 0.4
    """Minimum mean score of the latest detections of a vehicle that is shown."""
    confirm_seconds: Seconds = 0.1
    """Evidence before a vehicle is shown: seconds of detections with score 1."""
    decay: Share = 0.2
    """Evidence that a vehicle loses in a second. Detections with lower scores never add up."""
    coast_seconds: Seconds = 0.35
    """Show a vehicle that is not detected for this long, by prediction."""
    keep_id_seconds: Seconds = 1.0
    """Keep the id of a vehicle that is not detected for this long."""
    keep_hidden_id_seconds: Seconds = 5.0
    """Keep the id of a vehicle hidden behind another one for this long."""


class RulesTrackerSettings(TrackerSettings):
    """The rules of the original system (`vdet.track.rules` lists them); times are in frames."""

    kind: Literal["rules"] = "rules"
    """motion or rules."""
    history: int = Field(10, ge=1, le=1000)
    """Number of detections that a car's box is averaged over."""
    min_region: Pixels = 50
    """Ignore detections narrower or lower than this."""
    near: Pixels = 50
    """Largest distance of a detection that is close to a car."""
    confident_peak: float = Field(2.0, ge=0)
    """A detection with a higher peak is trusted sooner."""
    detections_needed: int = Field(10, ge=1)
    """Detections in a row before a car is shown."""
    confident_detections_needed: int = Field(3, ge=1)
    """Detections in a row before a car is shown, after a confident peak."""
    wide: Pixels = 200
    """A wider detection is always good enough for its car."""
    good_fraction: Share = 2 / 3
    """A detection wider than this fraction of its car is good enough too."""
    max_combined: Pixels = 250
    """Two detections of one car, combined, must be narrower than this."""
    combined_tolerance: Share = 1 / 3
    """The width of the two may differ from the car's by this fraction of it."""
    merge_overlap: Pixels = 40
    """Cars in one detection that overlap by more, across and down, become one."""
    match_distance: Pixels = 50
    """Largest distance from its last place at which a car's image is searched."""
    match_score: Share = 0.5
    """Minimum score of a match; 1 is perfect."""
    young: int = Field(7, ge=0)
    """A car with fewer detections is deleted at its first miss."""
    max_matches: int = Field(12, ge=1)
    """A car is deleted after this many matches in a row."""
    max_misses: int = Field(5, ge=1)
    """A car is deleted after this many misses in a row."""

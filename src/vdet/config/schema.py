"""Every tunable, typed, with its default, its range and the words that `vdet config` prints.

The defaults are `configs/default.yaml`, which is their printed form.
"""

from typing import Literal

from pydantic import Field, model_validator

from vdet.config.detecting import (
    HeatSettings,
    PerspectiveSettings,
    SearchSettings,
    VoteSettings,
    WindowSettings,
)
from vdet.config.lanes import LaneSettings
from vdet.config.learning import (
    BoxSettings,
    CalibrationSettings,
    ColorSpace,
    FeatureSettings,
    HistogramSettings,
    HogSettings,
    MiningSettings,
    SpatialSettings,
    TrainingSettings,
    ViewSettings,
)
from vdet.config.section import FRAME_LENGTH, Fraction, Section
from vdet.config.tracker import MotionTrackerSettings, RulesTrackerSettings, TrackerSettings

__all__ = [
    "FRAME_LENGTH",
    "BoxSettings",
    "CalibrationSettings",
    "ColorSpace",
    "FeatureSettings",
    "HeatSettings",
    "HistogramSettings",
    "HogSettings",
    "InputSettings",
    "LaneSettings",
    "MiningSettings",
    "MotionTrackerSettings",
    "OutputSettings",
    "PerspectiveSettings",
    "RulesTrackerSettings",
    "SearchSettings",
    "Section",
    "Settings",
    "SpatialSettings",
    "TrackerSettings",
    "TrainingSettings",
    "ViewSettings",
    "VoteSettings",
    "WindowSettings",
]


class InputSettings(Section):
    """The video that is read."""

    max_damaged: Fraction = Field(
        0.05,
        description="share of damaged or lost frames that is tolerated; above it the video fails",
    )
    frame_rate: float = Field(
        25.0, ge=0.01, le=1000, description="frames a second of numbered pictures (img_%04d.png)"
    )


class OutputSettings(Section):
    """The video that is written."""

    codec: Literal["libx264"] = Field("libx264", description="H.264, which browsers play")
    preset: Literal["ultrafast", "superfast", "veryfast", "faster", "fast", "medium", "slow"] = (
        Field("superfast", description="ultrafast … slow: time against size")
    )
    crf: int = Field(20, ge=0, le=51, description="quality, 0 best, 51 worst")


class Settings(Section):
    """Everything. Lengths in pixels are for a frame of `reference_height` rows."""

    reference_height: int = Field(
        720,
        ge=16,
        le=100_000,
        description="lengths in frame pixels below (search, heat, tracker) are given for a frame "
        "with this many rows; for another frame they are multiplied by "
        "rows / reference_height and rounded",
    )
    features: FeatureSettings = FeatureSettings()
    training: TrainingSettings = TrainingSettings()
    mining: MiningSettings = MiningSettings()
    search: SearchSettings = SearchSettings()
    heat: HeatSettings = HeatSettings()
    tracker: TrackerSettings = MotionTrackerSettings()
    lanes: LaneSettings = LaneSettings()
    input: InputSettings = InputSettings()
    output: OutputSettings = OutputSettings()

    @model_validator(mode="after")
    def _heat_sees_every_set(self) -> "Settings":
        if self.heat.frames < self.search.alternate:
            raise ValueError("heat.frames must be at least search.alternate")
        return self

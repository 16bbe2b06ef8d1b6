"""The section `mining`: what `vdet mine` takes from each frame of labelled video."""

from pydantic import Field

from vdet.config.section import Section, Share


class MiningSettings(Section):
    """What `vdet mine` takes from each frame of labelled video."""

    probability: Share = Field(
        0.2, description="least probability of a false alarm: a window that shows no vehicle"
    )
    per_vehicle: int = Field(
        16,
        ge=0,
        le=10_000,
        description="most windows that fit a vehicle, and most others that show it",
    )
    false_alarms: int = Field(15, ge=0, le=10_000, description="most false alarms per frame")
    parts: int = Field(
        10,
        ge=0,
        le=10_000,
        description="most false alarms per frame on a part of a vehicle; with many of them, fewer "
        "vehicles are found as a whole",
    )

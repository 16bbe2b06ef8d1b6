"""The section `input`: the video that is read."""

from pydantic import Field

from vdet.config.section import Section, Share


class InputSettings(Section):
    """The video that is read."""

    max_damaged: Share = Field(
        0.05,
        description="tolerated share of damaged or lost frames; a video with more of them fails",
    )
    frame_rate: float | None = Field(
        None,
        ge=0.01,
        le=1000,
        description="frames per second of numbered pictures (img_%04d.png); null: 25, with a "
        "warning",
    )

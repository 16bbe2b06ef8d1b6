"""The section `output`: the video that is written."""

from typing import Literal

from pydantic import Field

from vdet.config.section import Section


class OutputSettings(Section):
    """The video that is written."""

    codec: Literal["libx264"] = Field(
        "libx264", description="video codec; libx264 writes H.264, which browsers play"
    )
    preset: Literal["ultrafast", "superfast", "veryfast", "faster", "fast", "medium", "slow"] = (
        Field("superfast", description="speed of the encoder; slower presets write smaller files")
    )
    crf: int = Field(
        25, ge=0, le=51, description="quality of the video: 0 is the best, 51 the worst"
    )

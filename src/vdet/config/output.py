"""The section `output`: the video that is written."""

from typing import Literal

from pydantic import Field

from vdet.config.section import Section


class OutputSettings(Section):
    """The video that is written."""

    codec: Literal["libx264"] = Field("libx264", description="H.264, which browsers play")
    preset: Literal["ultrafast", "superfast", "veryfast", "faster", "fast", "medium", "slow"] = (
        Field("superfast", description="ultrafast … slow: time against size")
    )
    crf: int = Field(20, ge=0, le=51, description="quality, 0 best, 51 worst")
    scores: bool = Field(False, description="write the score of each box into its label")

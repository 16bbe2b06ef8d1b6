"""The sections `summary` and `crops`: a record and a picture of each vehicle."""

from typing import Literal

from pydantic import Field

from vdet.config.section import Section, Share


class SummarySettings(Section):
    """The record of each vehicle."""

    path_step: Share = Field(
        0.01,
        description="the path of a vehicle gets a point when it has gone so far, share of the "
        "frame's width; shorter ways are the trembling of the boxes",
    )


class CropSettings(Section):
    """The best picture of each vehicle."""

    padding: float = Field(
        0.1, ge=0, le=2, description="what is shown around the box, share of its sides"
    )
    least: int = Field(
        24, ge=1, le=10_000, description="smallest side of a box that gets a picture, pixels"
    )
    format: Literal["jpg", "png"] = Field("jpg", description="format of the pictures")

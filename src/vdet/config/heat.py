"""The section `detector.heat`: how the hits of consecutive frames become detections."""

from typing import Literal

from pydantic import Field

from vdet.config.section import Pixels, Section, Share


class VoteSettings(Section):
    """How the boxes of hits that agree on a vehicle are averaged."""

    agreement: Share = Field(
        0.35, description="least intersection over union of two boxes that agree"
    )
    inside: Share = Field(
        0.7, description="a box with more than this share inside a larger vehicle is a part of it"
    )
    least: float = Field(0.12, ge=0, description="least weight of the hits that agree on a vehicle")
    sharpness: float = Field(
        4.0,
        ge=0,
        le=16,
        description="weight of a hit in the average: -log(1 - probability) to this power, so that "
        "the windows that fit the vehicle best count most",
    )


class HeatSettings(Section):
    """How the hits of consecutive frames are summed into a heatmap, and become detections."""

    frames: int = Field(
        2, ge=1, le=100, description="number of searched frames whose hits are summed"
    )
    weight: Literal["none", "coverage"] = Field(
        "coverage",
        description="none: a hit adds its probability; coverage: a hit adds its probability "
        "divided by the number of windows of its set that cover a pixel, so that the threshold "
        "does not depend on their overlap",
    )
    shrink: Literal[1, 2, 4, 8] = Field(
        4, description="one value of the heatmap stands for this many pixels across and down"
    )
    blur: Pixels = Field(
        15,
        description="side of the Gaussian kernel that blurs the heat, pixels; 0 or 1 for no blur",
    )
    threshold: float = Field(
        0.075, ge=0, description="a region is hot where the heat is above this"
    )
    regions: Literal["outline", "votes"] = Field(
        "votes",
        description="outline: each hot region is a detection, and its box bounds the region; "
        "votes: the boxes of the hits in a region tell how many vehicles it shows, and where",
    )
    votes: VoteSettings = VoteSettings()

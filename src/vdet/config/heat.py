"""The section `detector.heat`: windows of consecutive frames become detections."""

from typing import Literal

from pydantic import Field

from vdet.config.section import Fraction, Pixels, Section


class VoteSettings(Section):
    """Boxes from the windows that voted: those that agree on a vehicle are averaged."""

    agreement: Fraction = Field(
        0.35, description="intersection over union from which on two votes agree"
    )
    inside: Fraction = Field(
        0.7, description="a vehicle of which this share lies in a larger one is a part of it"
    )
    least: float = Field(0.08, ge=0, description="weight of the votes that a vehicle needs")
    sharpness: float = Field(
        4.0,
        ge=0,
        le=16,
        description="how much more the windows count that fit a vehicle best, where its box is "
        "averaged: power of -log(1 - probability)",
    )


class HeatSettings(Section):
    """Detections of consecutive frames summed into a heatmap, and its regions."""

    frames: int = Field(2, ge=1, le=100, description="frames whose detections are summed")
    weight: Literal["none", "coverage"] = Field(
        "coverage",
        description="none: a window adds its probability; coverage: divided by the number of "
        "windows of its set that cover a pixel, so that the threshold does not depend on overlap",
    )
    shrink: Literal[1, 2, 4, 8] = Field(
        4, description="the map has one value for this many pixels across and down"
    )
    blur: Pixels = Field(15, description="side of the Gaussian blur, pixels; 0 or 1 for none")
    threshold: float = Field(0.05, ge=0, description="a region is where the heat is above this")
    regions: Literal["outline", "votes"] = Field(
        "votes",
        description="outline: a region's box bounds the hot part; votes: the windows in it say how "
        "many vehicles it is and where",
    )
    votes: VoteSettings = VoteSettings()

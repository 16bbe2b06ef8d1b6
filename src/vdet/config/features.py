"""The section `detector.features`: which features of a patch the model gets."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from vdet.config.section import Section

ColorSpace = Literal["YCrCb", "HSV", "LUV", "HLS", "YUV", "RGB"]


def _are_distinct(channels: tuple[int, ...]) -> tuple[int, ...]:
    if len(set(channels)) != len(channels):
        raise ValueError("channels must differ from one another")
    return channels


ChannelNumbers = Annotated[tuple[Literal[0, 1, 2], ...], AfterValidator(_are_distinct)]


class HogSettings(Section):
    """Histograms of oriented gradients (Dalal & Triggs 2005), as cv2.HOGDescriptor gives them."""

    orientations: int = Field(
        8, ge=2, le=32, description="number of bins for gradient directions of 0 to 180°"
    )
    cell: int = Field(4, ge=2, le=64, description="side of a cell, pixels of the patch")
    block: int = Field(
        2, ge=1, le=8, description="side of a block, cells; neighbouring blocks are one cell apart"
    )
    channels: ChannelNumbers = Field(
        (0, 1, 2), description="channels of the colour space that have HOG features; [] for none"
    )


class HistogramSettings(Section):
    """Colour histogram of each channel."""

    bins: Literal[0, 8, 16, 32, 64, 128, 256] = Field(
        32, description="number of equal bins for values of 0 to 255; 0 for no histogram"
    )


class FeatureSettings(Section):
    """Features of a patch; they must be those that the model was trained with."""

    patch: int = Field(32, ge=16, le=256, description="side of a patch, pixels")
    color_space: ColorSpace = Field(
        "YCrCb", description="colour space: YCrCb, HSV, LUV, HLS, YUV or RGB"
    )
    halved: ChannelNumbers = Field(
        (1, 2),
        description="channels of the colour space that are described at half their size, with HOG "
        "cells of half the side; video has chroma at half size",
    )
    hog: HogSettings = HogSettings()
    histogram: HistogramSettings = HistogramSettings()

    @model_validator(mode="after")
    def _cells_fill_the_patch(self) -> "FeatureSettings":
        if not (self.hog.channels or self.histogram.bins):
            raise ValueError("at least one of hog and histogram must be on")
        if self.patch % self.hog.cell:
            raise ValueError(f"patch must be a multiple of hog.cell ({self.hog.cell})")
        if self.hog.block * self.hog.cell > self.patch:
            raise ValueError("hog.block × hog.cell must not exceed patch")
        if self.halved and (self.hog.cell % 2 or self.hog.cell < 4):
            raise ValueError("hog.cell must be even, and 4 or more, or halved must be []")
        return self

    def shrink(self, channel: int) -> int:
        """Return how many times smaller than the patch a channel is described: 1 or 2."""
        return 2 if channel in self.halved else 1

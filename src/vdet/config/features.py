"""The section `detector.features`: what a patch is described by."""

from typing import Literal

from pydantic import Field, model_validator

from vdet.config.section import Section

ColorSpace = Literal["YCrCb", "HSV", "LUV", "HLS", "YUV", "RGB"]


class HogSettings(Section):
    """Histogram of oriented gradients (Dalal & Triggs 2005), as cv2.HOGDescriptor computes it."""

    orientations: int = Field(8, ge=2, le=32, description="bins of gradient direction in 180°")
    cell: int = Field(4, ge=2, le=64, description="side of a cell, patch pixels")
    block: int = Field(2, ge=1, le=8, description="side of a block, cells; blocks step by one cell")
    channels: tuple[Literal[0, 1, 2], ...] = Field(
        (0, 1, 2), description="channels of the colour space that are described; [] for none"
    )

    @model_validator(mode="after")
    def _channels_are_distinct(self) -> "HogSettings":
        if len(set(self.channels)) != len(self.channels):
            raise ValueError("channels must differ from one another")
        return self


class HistogramSettings(Section):
    """Colour histogram, one a channel."""

    bins: Literal[0, 8, 16, 32, 64, 128, 256] = Field(
        32, description="equal bins over the values 0 … 255 of each channel; 0 for no histogram"
    )


class SpatialSettings(Section):
    """The patch itself, shrunk, as raw values."""

    size: int = Field(0, ge=0, le=64, description="side of the shrunk patch, pixels; 0 for none")


class FeatureSettings(Section):
    """What a patch is described by. A model carries the settings that it was trained with."""

    patch: int = Field(32, ge=16, le=256, description="side of a patch, pixels")
    color_space: ColorSpace = Field("YCrCb", description="YCrCb, HSV, LUV, HLS, YUV or RGB")
    hog: HogSettings = HogSettings()
    histogram: HistogramSettings = HistogramSettings()
    spatial: SpatialSettings = SpatialSettings()

    @model_validator(mode="after")
    def _cells_fill_the_patch(self) -> "FeatureSettings":
        if self.hog.channels:
            if self.patch % self.hog.cell:
                raise ValueError(f"patch must be a multiple of hog.cell ({self.hog.cell})")
            if self.hog.block * self.hog.cell > self.patch:
                raise ValueError("hog.block × hog.cell must not exceed patch")
        elif not (self.histogram.bins or self.spatial.size):
            raise ValueError("at least one of hog, histogram and spatial must be on")
        return self

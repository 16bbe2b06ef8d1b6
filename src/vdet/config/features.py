"""The section `detector.features`: which features of a patch the model gets."""

from typing import Literal

from pydantic import Field, model_validator

from vdet.config.section import Section

ColorSpace = Literal["YCrCb", "HSV", "LUV", "HLS", "YUV", "RGB"]


class HogSettings(Section):
    """Histograms of oriented gradients (Dalal & Triggs 2005), as cv2.HOGDescriptor gives them."""

    orientations: int = Field(
        8, ge=2, le=32, description="number of bins for gradient directions of 0 to 180°"
    )
    cell: int = Field(4, ge=2, le=64, description="side of a cell, pixels of the patch")
    block: int = Field(
        2, ge=1, le=8, description="side of a block, cells; neighbouring blocks are one cell apart"
    )
    channels: tuple[Literal[0, 1, 2], ...] = Field(
        (0, 1, 2), description="channels of the colour space that have HOG features; [] for none"
    )

    @model_validator(mode="after")
    def _channels_are_distinct(self) -> "HogSettings":
        if len(set(self.channels)) != len(self.channels):
            raise ValueError("channels must differ from one another")
        return self


class HistogramSettings(Section):
    """Colour histogram of each channel."""

    bins: Literal[0, 8, 16, 32, 64, 128, 256] = Field(
        32, description="number of equal bins for values of 0 to 255; 0 for no histogram"
    )


class SpatialSettings(Section):
    """The pixels of the shrunk patch."""

    size: int = Field(
        0, ge=0, le=64, description="side of the shrunk patch, pixels; 0 for no such features"
    )


class FeatureSettings(Section):
    """Features of a patch; they must be those that the model was trained with."""

    patch: int = Field(32, ge=16, le=256, description="side of a patch, pixels")
    color_space: ColorSpace = Field(
        "YCrCb", description="colour space: YCrCb, HSV, LUV, HLS, YUV or RGB"
    )
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

"""What a patch is described by, and how the classifier learns."""

from typing import Literal

from pydantic import Field, model_validator

from vdet.config.section import Fraction, Section

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


class CalibrationSettings(Section):
    """Probability from score: a sigmoid fitted on patches the SVM has not seen (Platt 1999)."""

    folds: int = Field(3, ge=2, le=20, description="cross-validation folds")
    ensemble: bool = Field(
        False,
        description="true: keep one SVM a fold and average their probabilities; "
        "false: one SVM fitted on everything, calibrated on the folds",
    )


class ViewSettings(Section):
    """What is learnt from a patch besides the patch itself; a held-out patch gives no views."""

    mirror: bool = Field(True, description="its mirror image; the views below are of both")
    cut: Fraction = Field(
        0.15,
        description="share of patches of which is added how the frame's left or right side, "
        "repeated, would cut 15 to 50 % off",
    )
    parts: Fraction = Field(
        0.05,
        description="share of vehicle patches of which a crop, 40 to 60 % of a side, is added as a "
        "non-vehicle",
    )


class BoxSettings(Section):
    """Linear regression of the sides of a vehicle's box, where patches come with boxes."""

    penalty: float = Field(
        1.0, gt=0, le=1e6, description="ridge penalty of the scaled features' weights, a patch"
    )
    assumed: float = Field(
        0.5,
        ge=0,
        le=100,
        description="weight, against that of patches with boxes, of vehicle patches from sources "
        "without: these are taken to be filled by their vehicle",
    )


class TrainingSettings(Section):
    """How `vdet train` fits the classifier."""

    C: float = Field(3e-5, gt=0, le=1e6, description="penalty of the linear SVM; less is smoother")
    test_fraction: float = Field(
        0.2, gt=0, lt=1, description="share of patches held out for the test"
    )
    split: Literal["random", "tail"] = Field(
        "random",
        description="random: any patch may be held out (near-duplicates leak); "
        "tail: the last of each folder, in numeric order of file names",
    )
    max_iterations: int = Field(1000, ge=1, description="of the SVM's solver")
    seed: int = Field(0, ge=0, le=2**32 - 1, description="of the split, the folds and the solver")
    max_broken: Fraction = Field(0.01, description="share of unreadable patches that is tolerated")
    calibration: CalibrationSettings = CalibrationSettings()
    views: ViewSettings = ViewSettings()
    boxes: BoxSettings = BoxSettings()


class MiningSettings(Section):
    """What `vdet mine` takes from each frame of labelled video."""

    probability: Fraction = Field(
        0.2, description="a window that shows no vehicle is a false alarm from here on"
    )
    per_vehicle: int = Field(
        16,
        ge=0,
        le=10_000,
        description="most windows that fit a vehicle, and most others around it",
    )
    false_alarms: int = Field(15, ge=0, le=10_000, description="most of these, a frame")
    parts: int = Field(
        10,
        ge=0,
        le=10_000,
        description="most false alarms on a part of a vehicle, a frame; with many of them, fewer "
        "vehicles are found whole",
    )

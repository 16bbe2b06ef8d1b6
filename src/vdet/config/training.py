"""The section `training`: how `vdet train` fits the classifier."""

from typing import Literal

from pydantic import Field

from vdet.config.section import Section, Share


class CalibrationSettings(Section):
    """Sigmoid from decision values to probabilities, fitted on patches unknown to the SVM."""

    folds: int = Field(3, ge=2, le=20, description="cross-validation folds")
    ensemble: bool = Field(
        False,
        description="true: keep one SVM per fold and average their probabilities; "
        "false: one SVM fitted on everything, calibrated on the folds",
    )


class AugmentationSettings(Section):
    """Samples made of each training patch and learned from too."""

    mirror: bool = Field(
        True, description="add the mirror image; the samples below are made of both"
    )
    cut: Share = Field(
        0.15,
        description="share of patches of which a copy is added that the frame's left or right side "
        "cuts off by 15 to 50 %",
    )
    parts: Share = Field(
        0.05,
        description="share of vehicle patches of which a crop, 40 to 60 % of the width and height, "
        "is added as a non-vehicle",
    )


class BoxSettings(Section):
    """Linear regression of the sides of a vehicle's box, if patches have boxes."""

    penalty: float = Field(
        1.0, gt=0, le=1e6, description="ridge penalty of the scaled features' weights per patch"
    )
    assumed: float = Field(
        0.5,
        ge=0,
        le=100,
        description="weight of the vehicle patches from sources without boxes, relative to patches "
        "with boxes; their vehicle is assumed to fill the patch",
    )


class SvmTrainingSettings(Section):
    """How `vdet train` fits the classifier."""

    C: float = Field(
        3e-5, gt=0, le=1e6, description="penalty of the linear SVM; smaller is smoother"
    )
    test_fraction: float = Field(
        0.2, gt=0, lt=1, description="share of patches held out for the test"
    )
    split: Literal["random", "tail"] = Field(
        "random",
        description="random: any patch may be held out (near-duplicates leak); "
        "tail: the last of each folder, in numeric order of file names",
    )
    max_iterations: int = Field(1000, ge=1, description="most iterations of the SVM's solver")
    seed: int = Field(
        0,
        ge=0,
        le=2**32 - 1,
        description="seed of the split, the folds and the augmentation",
    )
    max_broken: Share = Field(0.01, description="tolerated share of unreadable patches")
    calibration: CalibrationSettings = CalibrationSettings()
    augmentation: AugmentationSettings = AugmentationSettings()
    boxes: BoxSettings = BoxSettings()

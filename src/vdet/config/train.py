"""The section `train`: how models are trained."""

from typing import Annotated, Literal

from pydantic import Field

from vdet.config.section import Section, Share


class AugmentationSettings(Section):
    """Samples made of each training patch and learnt too."""

    mirror: bool = Field(
        True, description="Add the mirror image. The samples below are made of both."
    )
    cut: Share = Field(
        0.15,
        description="Share of patches of which a copy is added that the frame's left or right side "
        "cuts off by 15 to 50 %.",
    )
    parts: Share = Field(
        0.05,
        description="Share of vehicle patches of which a crop, 40 to 60 % of the width and height, "
        "is added as a non-vehicle.",
    )


class SvmTrainingSettings(Section):
    """How `vdet train` fits the linear SVM."""

    C: float = Field(
        3e-5, gt=0, le=1e6, description="Penalty of errors. Smaller values give a smoother model."
    )
    split: Literal["random", "tail"] = Field(
        "random",
        description="Patches that are held out for the test. random: any (near-duplicates leak). "
        "tail: the last of each folder, in numeric order of file names.",
    )
    seed: int = Field(
        0,
        ge=0,
        le=2**32 - 1,
        description="Seed of the split, the folds and the augmentation.",
    )
    max_broken: Share = Field(0.01, description="Largest accepted share of unreadable patches.")
    ensemble: bool = Field(
        False,
        description="true: keep an SVM for each fold of the calibration and average their "
        "probabilities. false: fit one SVM to everything.",
    )
    augmentation: AugmentationSettings = AugmentationSettings()


class MiningSettings(Section):
    """What `vdet mine` takes from each frame of labelled video."""

    probability: Share = Field(
        0.2, description="Least probability of a false alarm: a window that shows no vehicle."
    )


class NetworkScoreSettings(Section):
    """Score of a box: sigmoid(slope · x + offset), where x is the output of the network.

    It is the share of boxes with such an output that show a vehicle, fitted on cameras that were
    left out of the training; written into the network's header.
    """

    slope: float = Field(2.675, gt=0, le=100, description="Steepness of the score as x grows.")
    offset: float = Field(0.61, ge=-100, le=100, description="Added to x times slope.")


class NetworkTrainingSettings(Section):
    """How `vdet train-net` trains the network."""

    steps: int = Field(5200, ge=1, le=10_000_000, description="Number of steps.")
    batch: int = Field(16, ge=1, le=1024, description="Number of pictures in a step.")
    width: int = Field(640, ge=64, le=4096, multiple_of=64, description="Width of the pictures.")
    height: int = Field(352, ge=64, le=4096, multiple_of=32, description="Height of the pictures.")
    rate: float = Field(1e-3, gt=0, le=1, description="Highest learning rate of AdamW.")
    weights: dict[str, Annotated[float, Field(gt=0, le=1000)]] = Field(
        {}, description="How often to draw pictures of a set, by its name, relative to others."
    )
    score: NetworkScoreSettings = NetworkScoreSettings()


class TrainSettings(Section):
    """Training of models: `vdet train`, `vdet mine` and `vdet train-net`."""

    svm: SvmTrainingSettings = SvmTrainingSettings()
    mine: MiningSettings = MiningSettings()
    net: NetworkTrainingSettings = NetworkTrainingSettings()

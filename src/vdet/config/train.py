"""The section `train`: how models are trained."""

from typing import Annotated

from pydantic import Field

from vdet.config.section import Section, Share


class SvmTrainingSettings(Section):
    """How `vdet train` fits the linear SVM."""

    C: float = Field(3e-5, gt=0, le=1e6)
    """Penalty of errors. Smaller values give a smoother model."""
    augmentation: bool = True
    """Learn from further samples: the mirror image of each patch, and of some patches a copy that
    the side of a frame cuts off, and a part as an example of what is not a vehicle.
    """


class NetworkTrainingSettings(Section):
    """How `vdet train-net` trains the network."""

    steps: int = Field(4700, ge=1, le=10_000_000)
    """Number of steps."""
    batch: int = Field(16, ge=1, le=1024)
    """Number of pictures in a step."""
    width: int = Field(640, ge=64, le=4096, multiple_of=64)
    """Width of the pictures."""
    height: int = Field(352, ge=64, le=4096, multiple_of=32)
    """Height of the pictures."""
    learning_rate: float = Field(1e-3, gt=0, le=1)
    """Highest learning rate of AdamW."""
    classes: tuple[str, ...] = Field(
        ("car", "truck", "bus", "motorcycle", "bicycle", "person"), min_length=1, max_length=100
    )
    """Classes to learn, in the order of the network's outputs."""
    repeat_threshold: Share = 0.4
    """Draw pictures with a class that is in a smaller fraction of the pictures more often. 0: do
    not.
    """
    weights: dict[str, Annotated[float, Field(gt=0, le=1000)]] = Field({})
    """How often to draw pictures of a set, by its name, relative to others."""


class TrainSettings(Section):
    """Training of models: `vdet train` and `vdet train-net`."""

    svm: SvmTrainingSettings = SvmTrainingSettings()
    net: NetworkTrainingSettings = NetworkTrainingSettings()

"""The section `network`: how `vdet train-net` trains the network."""

from typing import Annotated

from pydantic import Field, model_validator

from vdet.config.section import Section, Share


class NetworkScoreSettings(Section):
    """Score of a box: sigmoid(slope · x + offset), where x is the output of the network.

    It is the share of boxes with such an output that show a vehicle, fitted on cameras that were
    left out of the training; written into the network's header.
    """

    slope: float = Field(2.675, gt=0, le=100, description="how steeply the score rises with x")
    offset: float = Field(0.61, ge=-100, le=100, description="added to x times slope")


class NetworkTrainingSettings(Section):
    """How `vdet train-net` trains the network."""

    steps: int = Field(20_000, ge=1, le=10_000_000, description="steps of the training")
    batch: int = Field(16, ge=1, le=1024, description="pictures in a step")
    width: int = Field(512, ge=64, le=4096, multiple_of=64, description="width of the pictures")
    height: int = Field(288, ge=64, le=4096, multiple_of=32, description="height of the pictures")
    small: Share = Field(
        0.7, description="share of the steps, from the first on, with pictures of half the size"
    )
    rate: float = Field(2e-3, gt=0, le=1, description="highest learning rate of AdamW")
    last_rate: Share = Field(0.02, description="the last learning rate, share of the highest")
    warm_up: int = Field(300, ge=0, description="steps in which the learning rate rises")
    weight_decay: float = Field(0.02, ge=0, le=1, description="weight decay of AdamW")
    gradient: float = Field(10.0, gt=0, description="longest gradient; longer ones are shortened")
    average: Share = Field(
        0.998, description="the moving average of the weights keeps this share at each step"
    )
    scales: tuple[float, float] = Field(
        (0.6, 2.2), description="least and most scale of a picture; at 1 its width fits"
    )
    mosaics: Share = Field(0.35, description="share of pictures put together of four")
    mosaic_scales: tuple[float, float] = Field(
        (0.5, 1.5), description="least and most scale of the four pictures of a mosaic"
    )
    plain: Share = Field(0.12, description="share of the steps, the last ones, without mosaics")
    weights: dict[str, Annotated[float, Field(gt=0, le=1000)]] = Field(
        {}, description="pictures of the set of this name are drawn so many times as often"
    )
    least_side: float = Field(
        10.0,
        ge=0,
        le=1000,
        description="vehicles whose longer side is shorter, in pixels, are ignored",
    )
    every: int = Field(8, ge=1, description="every n-th frame of a labelled video is learnt")
    checkpoint: int = Field(500, ge=1, description="steps between two checkpoints")
    seed: int = Field(0, ge=0, le=2**32 - 1, description="seed of the weights and the pictures")
    score: NetworkScoreSettings = NetworkScoreSettings()

    @model_validator(mode="after")
    def _scales_ascend(self) -> "NetworkTrainingSettings":
        for low, high in (self.scales, self.mosaic_scales):
            if not 0 < low <= high <= 100:
                raise ValueError("scales must be two numbers above 0, the smaller first")
        return self

"""The section `detector`: which detector finds vehicles, and its settings."""

from collections.abc import Hashable
from typing import Literal

from pydantic import Field, model_validator

from vdet.config.features import FeatureSettings
from vdet.config.heat import HeatSettings
from vdet.config.search import SearchSettings
from vdet.config.section import Fraction, Section


class DetectorSettings(Section):
    """Which detector finds vehicles, and its settings. Each kind has a class of its own."""

    kind: str

    @property
    def search_key(self) -> Hashable:
        """What the search of a frame depends on.

        Detectors whose settings have the same key, and that read the same model file, find the
        same candidates in a frame.
        """
        return self


class StillSettings(Section):
    """What a single picture shows; in video the tracker decides."""

    strength: float = Field(
        0.42,
        ge=0,
        description="vehicles with weaker evidence (heat, or weight of votes) are left out",
    )
    width: Fraction = Field(
        0.028, description="narrower vehicles are left out, share of the picture's width"
    )
    height: Fraction = Field(
        0.0, description="lower vehicles are left out, share of the picture's height"
    )


class ScoreSettings(Section):
    """How the evidence for a vehicle becomes its score, the share of such boxes that are vehicles.

    score = 1 / (1 + (middle / evidence) ** slope), fitted on frames that the model has not seen.
    """

    middle: float = Field(
        0.3, gt=0, le=1e6, description="evidence at which half of the boxes are vehicles"
    )
    slope: float = Field(2.0, gt=0, le=100, description="how steeply the score rises there")


class SvmSettings(DetectorSettings):
    """The linear SVM on HOG and colour features, with sliding windows and a heatmap."""

    kind: Literal["svm"] = Field(
        "svm", description="svm: the linear SVM on HOG and colour features"
    )
    reference_height: int = Field(
        720,
        ge=16,
        le=100_000,
        description="lengths in frame pixels below (search, heat) are for a frame with this many "
        "rows; for another frame they are multiplied by rows / reference_height and rounded",
    )
    features: FeatureSettings = FeatureSettings()
    search: SearchSettings = SearchSettings()
    heat: HeatSettings = HeatSettings()
    score: ScoreSettings = ScoreSettings()
    stills: StillSettings = StillSettings()

    @property
    def search_key(self) -> Hashable:
        """What the search of a frame depends on: all but heat, score and still pictures."""
        return self.kind, self.reference_height, self.features, self.search

    @model_validator(mode="after")
    def _heat_sees_every_set(self) -> "SvmSettings":
        if self.heat.frames < self.search.alternate:
            raise ValueError("heat.frames must be at least search.alternate")
        return self

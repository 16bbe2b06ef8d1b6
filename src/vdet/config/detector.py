"""The section `detector`: which detector finds vehicles, and its settings."""

import math
from collections.abc import Hashable
from fractions import Fraction
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field

from vdet.config.features import FeatureSettings
from vdet.config.heat import HeatSettings
from vdet.config.search import SearchSettings
from vdet.config.section import Section, Share

Searches = Annotated[
    float,
    Field(
        ge=0,
        le=1000,
        description="so many frames a second of a video are searched, or a few more; the tracker "
        "moves the vehicles on in the others; 0: all frames",
    ),
]


Foot = Annotated[
    float,
    Field(
        ge=-0.5,
        le=0.5,
        description="how far boxes end below the tyres, share of their height; taken off before "
        "the distance of a vehicle is measured",
    ),
]


class DetectorSettings(Section):
    """Which detector finds vehicles, and its settings; each kind has its own class.

    `model_suffix` is the ending of its model files; None for a kind whose files have no ending of
    their own.
    """

    model_suffix: ClassVar[str | None] = None

    kind: str
    searches: Searches = 0.0
    stride: int = Field(
        0,
        ge=0,
        le=100,
        description="one of so many frames is searched, whatever searches says; 0: as searches "
        "says",
    )
    foot: Foot = 0.0

    def stride_at(self, rate: float | Fraction) -> int:
        """Return that one of so many frames is searched in a video of `rate` frames a second."""
        return self.stride or max(1, int(rate / (self.searches or rate)))

    @property
    def search_key(self) -> Hashable:
        """What the search of a frame depends on, apart from which frames are searched.

        Detectors whose settings have the same key and the same stride, and that read the same model
        file, find the same candidates in a frame.
        """
        return self

    @property
    def vehicle_classes(self) -> tuple[str, ...]:
        """The classes that the detector looks for, of `vdet.detect.classes.OUR_NAMES`."""
        return "car", "truck", "bus", "vehicle"

    @property
    def shown_score(self) -> float:
        """Least score of a detection that is shown in a still picture."""
        return 0.0

    def showing_all(self) -> Self:
        """Return settings with which a still picture shows detections of every score."""
        return self


class StillSettings(Section):
    """Which detections are shown in a still picture; in video, the tracker decides."""

    strength: float = Field(
        0.84,
        ge=0,
        description="least evidence: heat, or with votes the weight of the hits that agree",
    )
    width: Share = Field(0.028, description="least width of a box, share of the picture's width")
    height: Share = Field(0.0, description="least height of a box, share of the picture's height")


class ScoreSettings(Section):
    """Score of a box: 1 / (1 + (middle / evidence) ** slope).

    It is the share of such boxes that show a vehicle. Fitted on frames that the model has not seen.
    """

    middle: float = Field(
        0.5,
        gt=0,
        le=1e6,
        description="evidence (heat, or weight of hits) at which the score is 0.5",
    )
    slope: float = Field(
        3.25, gt=0, le=100, description="how steeply the score rises with the evidence"
    )

    def of(self, evidence: float) -> float:
        """Return the score, 0 to 1, of a box with this evidence."""
        if not evidence:
            return 0.0
        relative = math.log(evidence) - math.log(self.middle)
        return (1 + math.tanh(self.slope * relative / 2)) / 2


class SvmSettings(DetectorSettings):
    """The detector: a linear SVM on HOG and colour features, sliding windows and a heatmap."""

    model_suffix: ClassVar[str | None] = ".npz"

    kind: Literal["svm"] = Field(
        "svm", description="kind of detector; svm: a linear SVM on HOG and colour features"
    )
    searches: Searches = 8.0
    foot: Foot = 0.04
    reference_height: int = Field(
        720,
        ge=16,
        le=100_000,
        description="height of the frames that lengths in pixels (detector.search.windows, "
        "detector.heat.blur) are given for; for frames of another height they are scaled",
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

    @property
    def shown_score(self) -> float:
        """Least score of a detection that is shown in a still picture."""
        return self.score.of(self.stills.strength)

    def showing_all(self) -> "SvmSettings":
        """Return settings without `stills.strength`; the least size stays."""
        return self.model_copy(update={"stills": self.stills.model_copy(update={"strength": 0.0})})


class NetworkSettings(DetectorSettings):
    """The detector: a network in an ONNX file, our own or another."""

    model_suffix: ClassVar[str | None] = ".onnx"

    kind: Literal["net"] = Field("net", description="kind of detector; net: a network")
    searches: Searches = 12.0
    least: float = Field(0.1, gt=0, lt=1, description="boxes with a lower score are not looked at")
    overlap: Share = Field(
        0.55,
        description="a box with more intersection over union with a better one is removed",
    )
    still_score: Share = Field(
        0.4,
        description="least score of a vehicle in a still picture; in video, the tracker decides",
    )
    classes: tuple[str, ...] = Field(
        ("car", "truck", "bus", "vehicle"),
        min_length=1,
        max_length=100,
        description="classes that count: car, truck, bus, motorcycle, vehicle (of unknown kind), "
        "or any other that the network knows",
    )
    names: tuple[str, ...] = Field(
        (),
        max_length=10_000,
        description="names of the classes in the network's order, where its file does not tell "
        "them",
    )

    @property
    def search_key(self) -> Hashable:
        """What the search of a frame depends on."""
        return self.kind, self.least, self.classes, self.names

    @property
    def vehicle_classes(self) -> tuple[str, ...]:
        """The classes that the detector looks for."""
        return self.classes

    @property
    def shown_score(self) -> float:
        """Least score of a detection that is shown in a still picture."""
        return self.still_score

    def showing_all(self) -> "NetworkSettings":
        """Return settings without `still_score`; `least` stays."""
        return self.model_copy(update={"still_score": 0.0})

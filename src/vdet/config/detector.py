"""The section `detector`: what all kinds of detectors have in common, and that of networks."""

from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field

from vdet.config.section import Section, Share

Searches = Annotated[float | None, Field(gt=0, le=1000)]
Foot = Annotated[float, Field(ge=-0.5, le=0.5)]


class DetectorSettings(Section):
    """Which detector finds vehicles, and its settings; each kind has its own class.

    `model_suffix` is the ending of its model files; None for a kind whose files have no ending of
    their own.
    """

    model_suffix: ClassVar[str | None] = None

    kind: str
    model: str | None = Field(None, min_length=1, max_length=4096)
    """Model file: .npz from `vdet train`, or .onnx. null: the shipped one that fits."""
    searches_per_second: Searches = None
    """Search at least this many frames in a second of video. The tracker predicts where the
    vehicles are in the others. null: search all frames.
    """
    stride: int | None = Field(None, ge=1, le=100)
    """Search every N-th frame. Overrides searches_per_second."""
    foot: Foot = 0.0
    """Distance from the tyres down to the lower edge of a box, as a fraction of its height. It
    corrects the distances of vehicles.
    """

    @property
    def search_key(self) -> object:
        """What the search of a frame depends on, apart from which frames are searched.

        Detectors whose settings have equal keys and the same stride, and that read the same model
        file, find the same candidates in a frame.
        """
        return self

    @property
    def vehicle_classes(self) -> tuple[str, ...]:
        """The classes that the detector looks for, of `vdet.detect.classes.OUR_NAMES`."""
        return "car", "truck", "bus", "vehicle"

    @property
    def shown_score(self) -> float:
        """Minimum score of a detection that is shown in a still picture."""
        return 0.0

    def showing_all(self) -> Self:
        """Return settings with which a still picture shows detections of every score."""
        return self


class NetworkSettings(DetectorSettings):
    """The detector: a network in an ONNX file, our own or another."""

    model_suffix: ClassVar[str | None] = ".onnx"

    kind: Literal["net"] = "net"
    """net: a network."""
    searches_per_second: Searches = 12.0
    min_score: float = Field(0.1, gt=0, lt=1)
    """Ignore boxes with a lower score."""
    nms_iou: Share = 0.55
    """Remove a box if its intersection over union with a better one is higher."""
    min_score_still: Share = 0.45
    """Minimum score of a vehicle in a still picture. In video, the tracker decides."""
    classes: tuple[str, ...] = Field(
        ("car", "truck", "bus", "motorcycle", "bicycle", "vehicle"), min_length=1, max_length=100
    )
    """Classes that count: car, truck, bus, motorcycle, bicycle, person, vehicle (of unknown kind),
    or any other that the network knows.
    """
    class_names: tuple[str, ...] | None = Field(None, max_length=10_000)
    """Names of the classes in the network's order. null: those in its file."""

    @property
    def search_key(self) -> object:
        """What the search of a frame depends on."""
        return self.kind, self.model, self.min_score, self.classes, self.class_names

    @property
    def vehicle_classes(self) -> tuple[str, ...]:
        """The classes that the detector looks for."""
        return self.classes

    @property
    def shown_score(self) -> float:
        """Minimum score of a detection that is shown in a still picture."""
        return self.min_score_still

    def showing_all(self) -> "NetworkSettings":
        """Return settings without `min_score_still`; `min_score` stays."""
        return self.model_copy(update={"min_score_still": 0.0})

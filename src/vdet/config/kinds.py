"""The sections `detector` and `tracker`: the settings of each kind, and who implements it.

The built-in kinds are here, so that reading settings imports no detector. `vdet.plugins` knows them
by name, together with those of other packages.
"""

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from pkgutil import resolve_name
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from vdet.config.classes import standard_classes
from vdet.config.section import FRAME_LENGTH, Pixels, Ratio, Section
from vdet.errors import ConfigError
from vdet.plugins import DETECTORS, TRACKERS, built_in_names, load_plugin

ClassNames = Annotated[tuple[str, ...], AfterValidator(standard_classes)]
Searches = Annotated[float | None, Field(gt=0, le=1000)]


class DetectorSettings(Section):
    """Which detector finds vehicles, and its settings; each kind has its own class."""

    kind: str
    model: str | None = Field(None, min_length=1, max_length=4096)
    """Model file: .npz from `vdet train`, or .onnx. null: the shipped model for these settings."""
    searches_per_second: Searches = None
    """Search at least this many frames per second of video; the tracker estimates the vehicles in
    the others. null: search all frames.
    """
    stride: int | None = Field(None, ge=1, le=100)
    """Search every N-th frame. Overrides searches_per_second."""
    min_score_still: Ratio = 0.0
    """Minimum score of a vehicle in a single image. In video, the tracker decides."""

    @property
    def vehicle_classes(self) -> tuple[str, ...]:
        """The classes that the detector looks for, of `vdet.config.classes.STANDARD_CLASSES`."""
        return "car", "truck", "bus", "vehicle"

    @property
    def class_minima(self) -> Mapping[str, float]:
        """The minimum scores of classes for which it is not `min_score_still`."""
        return {}

    @property
    def tyre_height(self) -> float:
        """Height of the tyres above the lower edge of a box, as a fraction of its height."""
        return 0.0

    def showing_all(self) -> Self:
        """Return settings with which a single image shows detections of every score."""
        return self.model_copy(update={"min_score_still": 0.0})


class NetworkSettings(DetectorSettings):
    """The detector: a network in an ONNX file, shipped or from another tool."""

    kind: Literal["net"] = "net"
    """net: a network."""
    searches_per_second: Searches = 12.0
    """Search at least this many frames per second of video, or about a third of them where nothing
    moves; the tracker estimates the vehicles in the others. null: search all frames.
    """
    min_score_still: Ratio = 0.4
    min_scores_still: dict[str, Ratio] = Field(
        {"truck": 0.55, "bus": 0.55, "bicycle": 0.3, "person": 0.2}, max_length=100
    )
    """Minimum scores of single classes in an image, instead of min_score_still."""
    min_score: float = Field(0.03, gt=0, lt=1)
    """Ignore boxes with a lower score. Of the others, a video shows what reaches tracker.min_score,
    and an image what reaches min_score_still.
    """
    nms_iou: Ratio = 0.55
    """Remove a box if its intersection over union with a better one is higher."""
    classes: ClassNames = Field(
        ("car", "truck", "bus", "motorcycle", "bicycle", "vehicle"), min_length=1, max_length=100
    )
    """Classes to detect: car, truck, bus, motorcycle, bicycle, person, vehicle (of unknown kind),
    or any other class of the network.
    """
    class_names: tuple[str, ...] | None = Field(None, max_length=10_000)
    """Class names in the order of the network. null: those in its file."""

    @property
    def vehicle_classes(self) -> tuple[str, ...]:
        """The classes that the detector looks for."""
        return self.classes

    @property
    def class_minima(self) -> Mapping[str, float]:
        """The minimum scores of classes for which it is not `min_score_still`."""
        return self.min_scores_still

    def showing_all(self) -> Self:
        """Return settings with which a single image shows detections of every score."""
        return super().showing_all().model_copy(update={"min_scores_still": {}})


class HogSettings(Section):
    """Histograms of oriented gradients (Dalal & Triggs 2005), computed by cv2.HOGDescriptor."""

    orientations: int = Field(8, ge=2, le=32)
    """Number of bins for gradient directions of 0 to 180°."""
    cell: int = Field(4, ge=2, le=64)
    """Side of a cell, in pixels of the patch."""
    block: int = Field(2, ge=1, le=8)
    """Side of a block, in cells."""


class HistogramSettings(Section):
    """Colour histogram of each channel."""

    bins: Literal[8, 16, 32, 64, 128, 256] = 32
    """Number of equal bins for values of 0 to 255."""


class FeatureSettings(Section):
    """Features of a patch; must match those that the model was trained with."""

    patch: int = Field(32, ge=16, le=256)
    """Side of a patch, in pixels."""
    halved: Annotated[tuple[Literal[0, 1, 2], ...], Field(max_length=3)] = (1, 2)
    """Channels of YCrCb to use at half size, with HOG cells of half the side. Video has chroma at
    half size.
    """
    hog: HogSettings = HogSettings()
    histogram: HistogramSettings = HistogramSettings()

    @model_validator(mode="after")
    def _cells_fill_the_patch(self) -> "FeatureSettings":
        if self.patch % self.hog.cell:
            raise ValueError(f"patch must be a multiple of hog.cell ({self.hog.cell})")
        if self.hog.block * self.hog.cell > self.patch:
            raise ValueError("hog.block × hog.cell must not exceed patch")
        if self.halved and (self.hog.cell % 2 or self.hog.cell < 4):
            raise ValueError("hog.cell must be even, and 4 or more, or halved must be []")
        return self

    @property
    def blocks(self) -> int:
        """Number of blocks across a patch; blocks are a cell apart."""
        return self.patch // self.hog.cell - self.hog.block + 1

    @property
    def hog_length(self) -> int:
        """Number of HOG features, which come first; 4,704 for the seed's settings."""
        return 3 * self.blocks**2 * self.hog.block**2 * self.hog.orientations

    @property
    def length(self) -> int:
        """Number of all features; 4,800 for the seed's settings."""
        return self.hog_length + 3 * self.histogram.bins

    def shrink(self, channel: int) -> int:
        """Return how many times smaller than the patch a channel is described: 1 or 2."""
        return 2 if channel in self.halved else 1


class WindowSettings(Section):
    """A set of square windows over a band of rows and the whole width of the frame."""

    size: Annotated[int, Field(ge=8, le=100_000), FRAME_LENGTH]
    """Side of a window, in pixels."""
    overlap: float = Field(ge=0, lt=1)
    """Fraction of a window that the next one overlaps."""
    top: Pixels
    """First row of the band."""
    bottom: Pixels
    """First row below the band."""

    @model_validator(mode="after")
    def _fits_its_band(self) -> "WindowSettings":
        if self.bottom - self.top < self.size:
            raise ValueError("bottom must be at least top + size")
        return self


class PerspectiveSettings(Section):
    """Window sets whose rows follow from their size, assuming a flat road."""

    sizes: tuple[Annotated[float, Field(gt=0, le=1)], ...] = Field(
        (0.05, 0.0625, 0.0875, 0.125, 0.175, 0.25, 0.3), max_length=32
    )
    """Side of the windows of each set, as a fraction of the frame's width. In frames wider than
    16:9, as a fraction of 16/9 of the height.
    """
    horizon: float | None = Field(None, ge=-1, le=1)
    """Row of the horizon, as a fraction of the frame's height. null: where the lines of the road
    meet in the first frames.
    """


class SearchSettings(Section):
    """The windows of a frame to search."""

    probability: Ratio = 0.3
    """Minimum probability of a hit, a window that counts as evidence."""
    windows: tuple[WindowSettings, ...] = Field((), max_length=32)
    """Window sets over fixed rows."""
    perspective: PerspectiveSettings = PerspectiveSettings()


class HeatSettings(Section):
    """How to sum the hits of consecutive frames into a heatmap, and turn it into detections."""

    frames: int = Field(2, ge=1, le=100)
    """Number of searched frames to sum."""
    threshold: float = Field(0.075, ge=0)
    """Heat above which a pixel is hot."""
    votes: float | None = Field(0.12, ge=0)
    """Minimum weight of the hits that agree on a vehicle: a hit adds less the more windows of its
    set cover a pixel; the boxes of the hits in a hot area decide how many vehicles it shows, and
    where. null: a hit adds its probability to the heat; each connected hot area is a detection,
    with its bounding box.
    """


class ScoreSettings(Section):
    """Score of a box: 1 / (1 + (middle / evidence) ** slope).

    It is the fraction of such boxes that show a vehicle. Fitted on frames that the model has not
    seen.
    """

    middle: float = Field(0.5, gt=0, le=1e6)
    """Evidence, heat or weight of hits, at which it is 0.5."""
    slope: float = Field(3.25, gt=0, le=100)
    """Steepness of the score as the evidence grows."""

    def of(self, evidence: float) -> float:
        """Return the score, 0 to 1, of a box with this evidence."""
        if not evidence:
            return 0.0
        relative = math.log(evidence) - math.log(self.middle)
        return (1 + math.tanh(self.slope * relative / 2)) / 2


class SvmSettings(DetectorSettings):
    """The detector: a linear SVM on HOG and colour features, sliding windows and a heatmap."""

    kind: Literal["svm"] = "svm"
    """svm: a linear SVM on HOG and colour features."""
    searches_per_second: Searches = 8.0
    min_score_still: Ratio = 0.844
    min_size_still: tuple[Ratio, Ratio] = (0.028, 0.0)
    """Minimum width and height of a vehicle in a single image, as fractions of the image's."""
    features: FeatureSettings = FeatureSettings()
    search: SearchSettings = SearchSettings()
    heat: HeatSettings = HeatSettings()
    score: ScoreSettings = ScoreSettings()

    @property
    def tyre_height(self) -> float:
        """Height of the tyres above the lower edge of a box, as a fraction of its height."""
        return 0.0 if self.heat.votes is None else 0.04


Seconds = Annotated[float, Field(ge=0, le=1000)]
LookAhead = Annotated[float, Field(ge=0, le=10)]


class TrackerSettings(Section):
    """How detections become tracks. Each kind has a class of its own."""

    kind: str
    look_ahead: LookAhead = 0.0
    """Seconds of video to search ahead of a frame before it is shown, so that vehicles are shown
    from their first detection to their last. 0: show frames at once.
    """
    min_score_standing: Ratio = 0.6
    """Before a fixed camera: minimum score of a vehicle that has not moved to be shown."""


class MotionTrackerSettings(TrackerSettings):
    """The motion tracker (`vdet.track.motion` explains it); times are in seconds."""

    kind: Literal["motion"] = "motion"
    """motion: assume steady motion, also while a vehicle is hidden or not detected. rules: the
    rules of the original system, which count frames.
    """
    look_ahead: LookAhead = 0.6
    min_size: Ratio = 0.018
    """Minimum size of a vehicle to be shown: √(width × height), as a fraction of the frame's width.
    At 0.018, a car seen from behind is 2 % of the frame wide.
    """
    min_score: Ratio = 0.4
    """Minimum mean score of a vehicle's latest detections to be shown. Values below
    detector.min_score have no effect. See min_score_standing.
    """
    confirm_seconds: Seconds = 0.1
    """Evidence needed to show a vehicle: seconds of detections with score 1."""
    decay: Ratio = 0.2
    """Evidence that a vehicle loses per second. Detections with lower scores never add up."""
    coast_seconds: Seconds = 0.35
    """Seconds to show a vehicle without detections, by prediction."""
    keep_id_seconds: Seconds = 1.0
    """Seconds to keep the id of a vehicle without detections."""
    keep_hidden_id_seconds: Seconds = 5.0
    """Seconds to keep the id of a vehicle hidden behind another."""


class RulesTrackerSettings(TrackerSettings):
    """The rules of the original system (`vdet.track.rules` lists them); times are in frames."""

    renamed: ClassVar[Mapping[str, str]] = {
        "near": "max_distance", "wide": "accepted_width", "young": "detections_to_keep",
    }  # fmt: skip

    kind: Literal["rules"] = "rules"
    """motion or rules."""
    history: int = Field(10, ge=1, le=1000)
    """Number of detections to average for a car's box."""
    min_region: Pixels = 50
    """Ignore detections narrower or lower than this."""
    max_distance: Pixels = 50
    """Maximum distance of a detection from its car."""
    confident_peak: float = Field(2.0, ge=0)
    """Heat above which a peak is confident, and its car is shown earlier."""
    detections_needed: int = Field(10, ge=1)
    """Consecutive detections needed to show a car."""
    confident_detections_needed: int = Field(3, ge=1)
    """Consecutive detections needed to show a car after a confident peak."""
    accepted_width: Pixels = 200
    """A wider detection is always accepted for its car."""
    good_fraction: Ratio = 2 / 3
    """A detection wider than this fraction of its car is also accepted."""
    max_combined: Pixels = 250
    """Maximum width of two combined detections of one car."""
    combined_tolerance: Ratio = 1 / 3
    """Maximum difference between the combined and the car's width, as a fraction of the car's
    width."""
    merge_overlap: Pixels = 40
    """Cars in one detection merge if they overlap by more, horizontally and vertically."""
    match_distance: Pixels = 50
    """Maximum distance from a car's last position to search its image."""
    match_score: Ratio = 0.5
    """Minimum score of a match; 1 is perfect."""
    detections_to_keep: int = Field(7, ge=0)
    """Minimum detections to keep a car at its first miss."""
    max_matches: int = Field(12, ge=1)
    """Consecutive matches after which a car is deleted."""
    max_misses: int = Field(5, ge=1)
    """Consecutive misses after which a car is deleted."""


GROUPS = {"detector": DETECTORS, "tracker": TRACKERS}
"""The sections with kinds, and the groups of entry points in which other packages register theirs.

The key `kind` of such a section names its kind.
"""


@dataclass(frozen=True, slots=True)
class DetectorKind:
    """A kind of detector, as registered under its name.

    Attributes
    ----------
    settings
        Class of the section `detector` for this kind; the default of its `kind` is the name.
    load
        Loads the detector, a `DetectorModel`, from its settings and a model file, None for the
        shipped one.
    shipped
        Returns the shipped model file for given settings; None if the kind needs no file.
    model_suffix
        Suffix of its model files, which selects this kind; only for kinds of vdet itself.
    tracker
        Defaults of the section `tracker` that differ for this kind.
    """

    settings: type[DetectorSettings]
    load: Callable[[Any, Path | None], Any]
    shipped: Callable[[Any], Path | None] = lambda _: None
    model_suffix: str | None = None
    tracker: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class TrackerKind:
    """A kind of tracker, as registered under its name.

    Attributes
    ----------
    settings
        Class of the section `tracker` for this kind; the default of its `kind` is the name.
    make
        Makes a `VideoTracker` from these settings and the width and height of the frames, pixels.
    """

    settings: type[TrackerSettings]
    make: Callable[[Any, int, int], Any]


def _imported(name: str) -> Callable[..., Any]:
    """Return a function that imports another function when it is called, and calls it."""

    def call(*args: Any) -> Any:
        return resolve_name(name)(*args)

    return call


NET = DetectorKind(
    NetworkSettings,
    load=_imported("vdet.detect.onnx.detector:NetworkModel"),
    shipped=_imported("vdet.detect.onnx.detector:shipped_network"),
    model_suffix=".onnx",
)
SVM = DetectorKind(
    SvmSettings,
    load=_imported("vdet.detect.svm.detector:load_svm"),
    shipped=_imported("vdet.detect.svm.detector:shipped_model"),
    model_suffix=".npz",
    tracker={"look_ahead": 0.8},
)
MOTION = TrackerKind(MotionTrackerSettings, _imported("vdet.track.motion.tracker:MotionTracker"))
RULES = TrackerKind(RulesTrackerSettings, _imported("vdet.track.rules:make_rules_tracker"))


def default_kind(section: str) -> str:
    """Return the kind of a section for which none is chosen."""
    return built_in_names(GROUPS[section])[0]


def with_kind(section: str, values: Any) -> Any:
    """Validate the values of a section as the settings of their kind."""
    if values is not None and not isinstance(values, dict):
        return values
    kind = (values or {}).get("kind", default_kind(section))
    return load_plugin(GROUPS[section], str(kind)).settings.model_validate(values)


def tracker_defaults(detector: Any) -> dict[str, Any]:
    """Return the `DetectorKind.tracker` of a kind of detector, which may be unknown."""
    with suppress(ConfigError):
        return dict(load_plugin(DETECTORS, str(detector)).tracker)
    return {}


def kind_of_model(path: Path) -> str | None:
    """Return the kind of detector that a model file is for; None if its suffix does not tell."""
    kinds = {load_plugin(DETECTORS, name).model_suffix: name for name in built_in_names(DETECTORS)}
    return kinds.get(path.suffix.lower())

"""All settings, typed, each with its default, its range and its explanation.

The defaults are those of `configs/default.yaml`, which is their printed form.
"""

from collections.abc import Callable
from functools import partial
from typing import Annotated, Literal

from pydantic import (
    BeforeValidator,
    Field,
    SerializeAsAny,
    ValidationInfo,
    field_validator,
    model_validator,
)

from vdet.config.kinds import (
    ClassNames,
    DetectorSettings,
    MotionTrackerSettings,
    NetworkSettings,
    SvmSettings,
    TrackerSettings,
    with_kind,
)
from vdet.config.scene import (
    CameraSettings,
    FramePoint,
    RegionList,
    Shape,
    TrafficSettings,
    parse_date_time,
)
from vdet.config.section import Ratio, Section
from vdet.errors import ConfigError

Metres = Annotated[float, Field(gt=0, le=200)]


class LaneSettings(Shape):
    """The lane: whether to find it, and a trapezoid along its lines on a straight road.

    The trapezoid here is where many dashboard cameras see their lane. For a camera of your own,
    take an undistorted frame of a straight and level road. Choose two rows: the nearer one above
    the bonnet, the farther one a little below the horizon. Note the points at which the lines of
    the vehicle's lane cross them.
    """

    enabled: bool = False
    """Find and draw the lane."""
    points: tuple[FramePoint, FramePoint, FramePoint, FramePoint] = (
        (0.21, 0.93), (0.79, 0.93), (0.54, 0.63), (0.46, 0.63),
    )  # fmt: skip
    """Where the lines cross two rows: near left, near right, far right, far left; x and y."""
    metres: tuple[Metres, Metres] | None = None
    """Width of the lane, and distance between the two rows on the road, in metres. Measure the
    distance with dashes of known length, or compute focal length × width × (1 / width in the far
    row − 1 / width in the near row), with the last two and the focal length in pixels. null:
    unknown, so there are no values in metres.
    """

    @model_validator(mode="after")
    def _is_a_trapezoid(self) -> "LaneSettings":
        (x1, bottom), (x2, also_bottom), (x3, top), (x4, also_top) = self.points
        if bottom != also_bottom or top != also_top or bottom <= top:
            raise ValueError("points must be two in a near row, then two in a far row")
        if not 0 < x3 - x4 < 0.9 * (x2 - x1):
            raise ValueError("the lines must be closer together in the far row")
        return self


Code = Literal[
    "camera-moves", "camera-moved", "unexplained-motion", "dark", "haze", "blur", "drops",
    "corrections", "cut", "frame-rate", "ground", "lane", "lane-geometry", "line", "nothing-found",
    "small-frames", "traces", "uncertain",
]  # fmt: skip
"""What makes a result doubtful; docs/conditions.md explains each."""


class SurveySettings(Section):
    """What the workbook of counts says of the survey."""

    site: str | None = Field(None, max_length=200)
    """Name of the place."""
    surveyor: str | None = Field(None, max_length=200)
    """Who is responsible."""
    weather: str | None = Field(None, max_length=200)
    """Weather and road conditions."""
    picture: str | None = Field(None, min_length=1, max_length=4096)
    """Image of the scene, with the aspect ratio of the frames. null: a frame, if a video is read.
    """


class ConditionSettings(Section):
    """Reasons to doubt a result: the findings about a video."""

    ignore: tuple[Code, ...] = Field((), max_length=100)
    """Codes of findings to suppress: camera-moves, camera-moved, unexplained-motion, dark, haze,
    blur, drops, cut, frame-rate, ground, lane, lane-geometry, line, nothing-found, small-frames,
    traces, uncertain.
    """


class SvmTrainingSettings(Section):
    """How `vdet train` fits the linear SVM."""

    C: float = Field(3e-5, gt=0, le=1e6)
    """Penalty of errors. Smaller values give a smoother model."""
    augmentation: bool = True
    """Add samples: the mirror image of each patch, and for some patches a copy cut off by the side
    of a frame, and a part as a negative example.
    """


class NetworkTrainingSettings(Section):
    """How `vdet train-net` trains the network."""

    steps: int = Field(4700, ge=1, le=10_000_000)
    """Number of steps."""
    batch: int = Field(16, ge=1, le=1024)
    """Number of images per step."""
    size: tuple[
        Annotated[int, Field(ge=64, le=4096, multiple_of=64)],
        Annotated[int, Field(ge=64, le=4096, multiple_of=32)],
    ] = (640, 352)
    """Width and height of the images, multiples of 64 and 32."""
    learning_rate: float = Field(1e-3, gt=0, le=1)
    """Highest learning rate of AdamW."""
    channels: float = Field(1.0, ge=0.25, le=4)
    """Factor of the channels of all layers; 2 has about four times the parameters."""
    classes: tuple[str, ...] = Field(
        ("car", "truck", "bus", "motorcycle", "bicycle", "person"), min_length=1, max_length=100
    )
    """Classes to learn, in the order of the network's outputs."""
    weights: dict[str, Annotated[float, Field(gt=0, le=1000)]] = Field({})
    """Relative sampling rate of a set's images, by its name."""


class TrainSettings(Section):
    """Training of models: `vdet train` and `vdet train-net`."""

    svm: SvmTrainingSettings = SvmTrainingSettings()
    net: NetworkTrainingSettings = NetworkTrainingSettings()


Role = Literal["vehicle", "ignored", "other"]
"""What a labelled box is in evaluation and training."""


class LabelSettings(Section):
    """Meaning of the labels of videos and images."""

    roles: dict[str, Role] = Field({}, max_length=1000)
    """vehicle: must be detected. ignored: detections there do not count. other: no vehicle. Without
    a role, car, truck, bus, motorcycle, bicycle, person and vehicle must be detected if they are in
    detector.classes, and are ignored otherwise.
    """


LabelPart = Literal["id", "class", "score", "distance"]


class InputSettings(Section):
    """The input video."""

    max_damaged: Ratio = 0.05
    """Maximum fraction of damaged or lost frames."""
    begin: str | None = Field(None, max_length=100)
    """Start time of the video, such as '2026-05-01 07:00+02:00'. null: from camera.clock."""
    frame_rate: float | None = Field(None, ge=0.01, le=1000)
    """Frames per second of numbered images (img_%04d.png) and of raw streams (.264, .mjpeg). null:
    that of the stream, else 25, with a warning.
    """

    @field_validator("begin")
    @classmethod
    def _is_a_date_and_time(cls, begin: str | None) -> str | None:
        if begin is not None:
            parse_date_time(begin)
        return begin


class OutputSettings(Section):
    """The output video, in H.264, and the pictures of pages, workbooks and `--crops`."""

    preset: Literal["ultrafast", "superfast", "veryfast", "faster", "fast", "medium", "slow"] = (
        "superfast"
    )
    """Speed of the encoder. Slower presets write smaller files."""
    crf: int = Field(25, ge=0, le=51)
    """Quality: 0 is the best, 51 the worst."""
    coarse: bool = False
    """Reduce these pictures until vehicles are about 40 pixels across, so that no face or number
    plate is readable. Videos stay as they are.
    """


class ClipSettings(Section):
    """The clips that `--clips` cuts out of a video."""

    margin: float = Field(2.0, ge=0, le=3600)
    """Seconds to add before and after a vehicle. Clips that touch are joined."""
    exact: bool = False
    """true: cut at exact frames, which encodes again. false: copy whole key-frame intervals."""


class DrawSettings(Section):
    """What to draw on videos and images."""

    label: tuple[LabelPart, ...] | None = Field(None, max_length=4)
    """Parts of the label in order: id, class, score, distance. Unknown values are omitted. []: no
    labels. null: the id in a video, the score in an image, and the class if it fits.
    """
    colors: Literal["id", "class", "one"] = "id"
    """Use one colour for each id, for each class, or for all vehicles (one)."""
    trails: Annotated[float, Field(gt=0, le=60)] | None = None
    """Seconds of each vehicle's path to draw in a video. null: no path."""


class Settings(Section):
    """All settings, one field for each section."""

    detector: Annotated[
        SerializeAsAny[DetectorSettings], BeforeValidator(partial(with_kind, "detector"))
    ] = NetworkSettings()
    tracker: Annotated[
        SerializeAsAny[TrackerSettings], BeforeValidator(partial(with_kind, "tracker"))
    ] = MotionTrackerSettings()
    camera: CameraSettings = CameraSettings()
    regions: RegionList = ()
    """Regions of the frame in which vehicles are shown.

    The position of a vehicle is the middle of its lower edge. Without an included region the whole
    frame counts, except excluded regions.
    """
    classes: ClassNames = Field((), max_length=100)
    """Classes of vehicles to show and count, out of detector.classes. []: all.

    The class is that of the track: in boxes the one two seconds later, everywhere else the final
    one.
    """
    steps: tuple[str, ...] = ()
    """Names of steps of other packages to run between the tracker and the outputs, in order."""
    traffic: TrafficSettings = TrafficSettings()
    survey: SurveySettings = SurveySettings()
    lanes: LaneSettings = LaneSettings()
    conditions: ConditionSettings = ConditionSettings()
    train: TrainSettings = TrainSettings()
    labels: LabelSettings = LabelSettings()
    input: InputSettings = InputSettings()
    output: OutputSettings = OutputSettings()
    clips: ClipSettings = ClipSettings()
    draw: DrawSettings = DrawSettings()

    @field_validator("classes")
    @classmethod
    def _are_looked_for(cls, classes: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        detector = info.data.get("detector")
        if classes and isinstance(detector, SvmSettings):
            raise ValueError("has no effect: the linear SVM has no classes")
        detected = detector.vehicle_classes if detector else classes
        for name in classes:
            if name not in detected:
                problem = f"{name}: unknown class; known: {', '.join(detected)}"
                raise ValueError(f"{problem}; detector.classes can have more")
        return classes

    def with_paths(self, change: Callable[[str], str]) -> "Settings":
        """Return the settings with the paths of the model file, masks and picture changed."""
        regions = tuple(
            region.model_copy(update={"mask": change(region.mask)}) if region.mask else region
            for region in self.regions
        )
        model = self.detector.model
        detector = self.detector.model_copy(update={"model": change(model) if model else None})
        picture = self.survey.picture
        survey = self.survey.model_copy(update={"picture": change(picture) if picture else None})
        update = {"regions": regions, "detector": detector, "survey": survey}
        return self.model_copy(update=update)

    @property
    def lack_of_metres(self) -> str | None:
        """What is missing for values in metres, if lanes are searched for without a camera."""
        needed = {"camera.lens": self.camera.lens, "lanes.metres": self.lanes.metres}
        missing = ", ".join(key for key, value in needed.items() if value is None)
        is_lacking = self.lanes.enabled and bool(missing)
        return f"lanes: no values in metres without {missing}" if is_lacking else None

    def __hash__(self) -> int:  # some fields are dictionaries
        return hash(self.model_dump_json())

    @property
    def svm(self) -> SvmSettings:
        """The settings of the linear SVM. Raises `ConfigError` where the detector is another."""
        if not isinstance(self.detector, SvmSettings):
            raise ConfigError(f"detector.kind: is {self.detector.kind}; this command needs -c svm")
        return self.detector

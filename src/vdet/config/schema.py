"""All settings, typed, each with its default, its range and its explanation.

The defaults are those of `configs/default.yaml`, which is their printed form.
"""

from collections.abc import Callable
from typing import Annotated, Literal

from pydantic import Field, SerializeAsAny, field_validator, model_validator

from vdet.config.camera import CameraSettings, moment
from vdet.config.conditions import ConditionSettings
from vdet.config.detector import DetectorSettings, NetworkSettings
from vdet.config.places import RegionList, TrafficSettings
from vdet.config.section import Section, Share
from vdet.config.svm import SvmSettings
from vdet.config.tracker import MotionTrackerSettings, TrackerSettings
from vdet.config.train import TrainSettings
from vdet.errors import ConfigError


class StepSettings(Section):
    """Steps of other packages, between the tracker and the outputs."""

    names: tuple[str, ...] = ()
    """Names of the steps, in order."""


class LaneSettings(Section):
    """The lane: whether it is looked for, and a trapezoid whose sides are its lines on a straight.

    The trapezoid here is where many dashboard cameras see their lane. For a camera of your own,
    take an undistorted frame of a straight and level road. Choose two rows: the nearer one above
    the bonnet, the farther one a little below the horizon. Note the columns at which the lines of
    the vehicle's lane cross them.
    """

    enabled: bool = False
    """Find the lane, and draw it."""
    top: Share = 0.63
    """Farther row, as a fraction of the frame's height."""
    bottom: Share = 0.93
    """Nearer row, as a fraction of the frame's height."""
    top_left: float = Field(0.46, ge=-2, le=3)
    """Column of the left line in the farther row, as a fraction of the frame's width."""
    top_right: float = Field(0.54, ge=-2, le=3)
    """Column of the right line in the farther row."""
    bottom_left: float = Field(0.21, ge=-2, le=3)
    """Column of the left line in the nearer row."""
    bottom_right: float = Field(0.79, ge=-2, le=3)
    """Column of the right line in the nearer row."""
    lane_width: float | None = Field(None, gt=0, le=20)
    """Width of the lane in metres. null: not known, so nothing is given in metres."""
    length: float | None = Field(None, gt=1, le=200)
    """Distance between the two rows on the road, in metres. Measure it by dashes of known length,
    or compute focal length × lane_width × (1 / lane width in the farther row − 1 / lane width in
    the nearer row), all but lane_width in pixels. null: not known, so nothing is given in metres.
    """

    @model_validator(mode="after")
    def _is_a_trapezoid(self) -> "LaneSettings":
        if self.bottom <= self.top:
            raise ValueError("bottom must be below top, a larger fraction of the height")
        far, near = self.top_right - self.top_left, self.bottom_right - self.bottom_left
        if not 0 < far < 0.9 * near:
            raise ValueError("the lines must be closer together at top than at bottom")
        return self


Role = Literal["vehicle", "ignored", "other"]
"""What a labelled box is in evaluation and training."""


class LabelSettings(Section):
    """What the labels of videos and pictures mean."""

    roles: dict[str, Role] = Field({}, max_length=1000)
    """vehicle: must be found. ignored: detections there are not judged. other: left out. Without a
    role, car, truck, bus, motorcycle, bicycle, person and vehicle must be found if the detector
    looks for them, and are ignored if not.
    """


LabelPart = Literal["id", "class", "score", "distance"]
Seconds = Annotated[float, Field(gt=0, le=60)]


class InputSettings(Section):
    """The video that is read."""

    max_damaged: Share = 0.05
    """Maximum fraction of damaged or lost frames."""
    begin: str | None = Field(None, max_length=100)
    """When the video begins, as in '2026-05-01 07:00+02:00'. null: as camera.clock says."""
    frame_rate: float | None = Field(None, ge=0.01, le=1000)
    """Frames per second of numbered pictures (img_%04d.png). null: 25, with a warning."""

    @field_validator("begin")
    @classmethod
    def _is_a_moment(cls, begin: str | None) -> str | None:
        if begin is not None:
            moment(begin)
        return begin


class OutputSettings(Section):
    """The video that is written, in H.264."""

    preset: Literal["ultrafast", "superfast", "veryfast", "faster", "fast", "medium", "slow"] = (
        "superfast"
    )
    """Speed of the encoder. Slower presets write smaller files."""
    crf: int = Field(25, ge=0, le=51)
    """Quality: 0 is the best, 51 the worst."""


class ClipSettings(Section):
    """The clips that `--clips` cuts out of a video."""

    margin: float = Field(2.0, ge=0, le=3600)
    """Seconds before and after a vehicle. Clips that touch are joined."""
    exact: bool = False
    """true: encode clips again, exact to the frame. false: copy from key frame to key frame."""


class DrawSettings(Section):
    """What is drawn on videos and pictures."""

    boxes: bool = True
    """Draw a box around each vehicle."""
    predicted: Literal["dashed", "plain", "hidden"] = "dashed"
    """How to draw vehicles whose place is predicted: with dashed boxes, plain boxes, or not at all.
    """
    label: tuple[LabelPart, ...] | None = Field(None, max_length=4)
    """Parts of the label in order: id, class, score, distance. Unknown ones are left out. []: no
    labels. null: the id in a video, the score in a picture, and the class where it fits.
    """
    colors: Literal["id", "class", "one"] = "id"
    """Use one colour for each id, for each class, or for all vehicles (one)."""
    thickness: float = Field(1.0, gt=0, le=20)
    """Factor of the width of lines, which otherwise depends on the frame."""
    trails: Seconds | None = None
    """Draw the path of each vehicle over this many seconds of a video."""
    time: bool = False
    """Draw the time since the first frame of a video."""


class Settings(Section):
    """All settings, one field for each section."""

    detector: SerializeAsAny[DetectorSettings] = NetworkSettings()
    tracker: SerializeAsAny[TrackerSettings] = MotionTrackerSettings()
    camera: CameraSettings = CameraSettings()
    regions: RegionList = ()
    """Regions of the frame in which vehicles are shown.

    A vehicle is where the middle of its lower edge is. Without an included region the whole frame
    counts, except for excluded ones.
    """
    steps: StepSettings = StepSettings()
    traffic: TrafficSettings = TrafficSettings()
    lanes: LaneSettings = LaneSettings()
    conditions: ConditionSettings = ConditionSettings()
    train: TrainSettings = TrainSettings()
    labels: LabelSettings = LabelSettings()
    input: InputSettings = InputSettings()
    output: OutputSettings = OutputSettings()
    clips: ClipSettings = ClipSettings()
    draw: DrawSettings = DrawSettings()

    def with_paths(self, change: Callable[[str], str]) -> "Settings":
        """Return the settings with the paths of the model file and of masks changed."""
        regions = tuple(
            region.model_copy(update={"mask": change(region.mask)}) if region.mask else region
            for region in self.regions
        )
        model = self.detector.model
        detector = self.detector.model_copy(update={"model": change(model) if model else None})
        return self.model_copy(update={"regions": regions, "detector": detector})

    @property
    def missing_for_metres(self) -> tuple[str, ...]:
        """The keys that are not given, and without which the lane has no metres."""
        needed = {
            "camera.lens": self.camera.lens,
            "lanes.lane_width": self.lanes.lane_width,
            "lanes.length": self.lanes.length,
        }
        return tuple(key for key, value in needed.items() if value is None)

    def __hash__(self) -> int:  # some fields are dictionaries
        return hash(self.model_dump_json())

    @property
    def svm(self) -> SvmSettings:
        """The settings of the linear SVM. Raises `ConfigError` where the detector is another."""
        if not isinstance(self.detector, SvmSettings):
            raise ConfigError(f"detector.kind: is {self.detector.kind}; this command needs -c svm")
        return self.detector

"""All settings, typed, each with its default, its range and its explanation.

The defaults are those of `configs/default.yaml`, which is their printed form.
"""

from pydantic import SerializeAsAny

from vdet.config.detector import DetectorSettings, NetworkSettings
from vdet.config.labels import LabelSettings
from vdet.config.lanes import LaneSettings
from vdet.config.places import (
    CountSettings,
    LineSettings,
    RegionSettings,
    RegionsSettings,
    ZoneSettings,
)
from vdet.config.section import Section
from vdet.config.svm import (
    ColorSpace,
    FeatureSettings,
    HeatSettings,
    HistogramSettings,
    HogSettings,
    PerspectiveSettings,
    ScoreSettings,
    SearchSettings,
    StillSettings,
    SvmSettings,
    WindowSettings,
)
from vdet.config.tracker import MotionTrackerSettings, RulesTrackerSettings, TrackerSettings
from vdet.config.train import (
    AugmentationSettings,
    MiningSettings,
    NetworkTrainingSettings,
    SvmTrainingSettings,
    TrainSettings,
)
from vdet.config.video import CropSettings, DrawSettings, InputSettings, OutputSettings
from vdet.errors import ConfigError


class StepSettings(Section):
    """Steps of other packages, between the tracker and the outputs."""

    names: tuple[str, ...] = ()
    """Names of the steps, in order."""


class Settings(Section):
    """All settings, one field for each section."""

    detector: SerializeAsAny[DetectorSettings] = NetworkSettings()
    tracker: SerializeAsAny[TrackerSettings] = MotionTrackerSettings()
    regions: RegionsSettings = RegionsSettings()
    steps: StepSettings = StepSettings()
    counts: CountSettings = CountSettings()
    lanes: LaneSettings = LaneSettings()
    train: TrainSettings = TrainSettings()
    labels: LabelSettings = LabelSettings()
    input: InputSettings = InputSettings()
    output: OutputSettings = OutputSettings()
    crops: CropSettings = CropSettings()
    draw: DrawSettings = DrawSettings()

    @property
    def svm(self) -> SvmSettings:
        """The settings of the linear SVM. Raises `ConfigError` where the detector is another."""
        if not isinstance(self.detector, SvmSettings):
            raise ConfigError(
                f"detector.kind: is {self.detector.kind}; this command works on the linear model: "
                "leave that setting out, or give -c svm"
            )
        return self.detector

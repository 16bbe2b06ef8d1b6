"""What is measured: shipped settings with their models, and frames of the project video."""

import os
from dataclasses import dataclass
from pathlib import Path

from vdet.config.loading import find_config, load_settings
from vdet.config.schema import Settings
from vdet.detect.svm.detector import SvmModel, shipped_model
from vdet.detect.svm.model import LinearModel, load_model
from vdet.media import Picture
from vdet.media.reader import VideoReader
from vdet.synthetic.render import write_clip
from vdet.synthetic.scene import demo_scene

FRAMES_SEARCHED = (20, 240, 470, 690, 760)  # of the project video, within its labelled part


@dataclass(frozen=True)
class ShippedConfig:
    """Shipped settings with the shipped model for them."""

    settings: Settings
    model: LinearModel

    @property
    def detector(self) -> SvmModel:
        return SvmModel(self.model, self.settings.svm)


def shipped_config(name: str) -> ShippedConfig:
    settings = load_settings([find_config(name)])
    return ShippedConfig(settings, load_model(shipped_model(settings.svm)))


def find_video(folder: Path) -> Path:
    """Return the project video; where it is not found, draw a 720p clip in `folder`."""
    root = Path(__file__).parents[1]
    places = [os.environ.get("VDET_DATA"), root / "data", root.parent / "shared" / "data"]
    for place in places:
        if place and (path := Path(place) / "project_video.mp4").exists():
            return path
    path = folder / "generated.mp4"
    write_clip(path, demo_scene(1, width=1280, height=720))
    return path


def read_pictures(path: Path) -> list[Picture]:
    """Return the frames that are searched, as they were decoded."""
    with VideoReader(path, frames=max(FRAMES_SEARCHED) + 1) as reader:
        read = [frame.picture for frame in reader if frame.index % 10 == 0]
    return [read[index // 10 % len(read)] for index in FRAMES_SEARCHED]

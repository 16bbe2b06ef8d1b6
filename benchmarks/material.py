"""What is measured: shipped models, the project video, and what runs are compared with."""

import itertools
import os
from pathlib import Path

import av
from av.video.frame import PictureType

from vdet.config.loading import find_config, load_settings
from vdet.config.schema import OutputSettings
from vdet.detect.svm.detector import SvmModel, load_svm
from vdet.media import Picture
from vdet.media.reader import VideoReader
from vdet.synthetic import demo_scene, write_clip

FRAMES_SEARCHED = (20, 240, 470, 690, 760)  # of the project video, within its labelled part


def shipped_svm(name: str) -> SvmModel:
    """Return the shipped linear model for shipped settings."""
    return load_svm(load_settings([find_config(name)]).svm, None)


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


def transcode(path: Path, out: Path, frames: int) -> None:
    """Decode and encode the first frames as the default settings do, and nothing else."""
    output = OutputSettings()
    options = {"preset": output.preset, "crf": str(output.crf)}
    with av.open(str(path)) as source, av.open(str(out), "w") as target:
        stream = source.streams.video[0]
        stream.thread_type = "AUTO"
        encoder = target.add_stream("libx264", rate=stream.average_rate, options=options)
        encoder.width, encoder.height = stream.width, stream.height
        for frame in itertools.islice(source.decode(stream), frames):
            frame.pict_type = PictureType.NONE  # the encoder chooses its own
            target.mux(encoder.encode(frame))
        target.mux(encoder.encode())

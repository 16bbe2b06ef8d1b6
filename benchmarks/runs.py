"""Whole runs of detect-video: wall time with and without outputs and lanes, and peak memory."""

import itertools
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import av
from av.video.frame import PictureType

from benchmarks.rounds import Task, measure
from vdet.config.places import (
    CountSettings,
    LineSettings,
    RegionSettings,
    RegionsSettings,
    ZoneSettings,
)
from vdet.config.schema import DrawSettings, OutputSettings, Settings, SvmSettings
from vdet.config.section import Section
from vdet.detect.factory import load_detector
from vdet.detect.protocol import DetectorModel
from vdet.lanes.camera import CalibratedCamera
from vdet.lanes.road import LaneRequest
from vdet.media import VideoReader
from vdet.run.sinks.protocol import Output
from vdet.run.video import VideoJob, run_video

FRAMES = 250
CAMERA = CalibratedCamera(
    1280, 720, ((1157, 0, 668), (0, 1153, 388), (0, 0, 1)), (-0.25, 0.0, 0.0, 0.0, 0.0), 0.0
)
"""Similar to the project video's camera; the numbers do not change the time of undistortion."""


ANSWERS: dict[str, Section] = {
    "regions": RegionsSettings(
        polygons=(RegionSettings(name="all", points=((0, 0), (1, 0), (1, 1), (0, 1))),)
    ),
    "counts": CountSettings(
        lines=tuple(
            LineSettings(name=f"row {row}", start=(0, row), end=(1, row), left="up", right="down")
            for row in (0.65, 0.7, 0.75)
        ),
        zones=(
            ZoneSettings(name="near", points=((0.5, 0.6), (1, 0.6), (1, 1), (0.7, 1))),
            ZoneSettings(name="left", points=((0, 0.6), (0.5, 0.6), (0.3, 1), (0, 1))),
        ),
    ),
    "draw": DrawSettings(trails=2),
}
"""A region that leaves nothing out, three lines and two zones, and trails."""


def run_times(path: Path, folder: Path, rounds: int) -> dict[str, float]:
    """Return the seconds that the first `FRAMES` frames take.

    Keys: `transcode` (decoded, and encoded with the same settings), `detect` (vehicles detected,
    drawn and written), `detect with lanes`, `detect with svm`, `detect with answers` (`ANSWERS`,
    counts and records of vehicles too), `detect only` and `detect only with svm` (nothing written).
    """
    out = folder / "out.mp4"
    video = (Output("video", out),)
    files = Output("counts", folder / "counts.csv"), Output("vehicles", folder / "cars.csv")
    default, svm = Settings(), Settings(detector=SvmSettings())
    answering = default.model_copy(update=ANSWERS)
    model, linear = load_detector(default.detector), load_detector(svm.detector)

    def detect(
        detector: DetectorModel,
        outputs: tuple[Output, ...] = video,
        settings: Settings = default,
        lanes: LaneRequest | None = None,
    ) -> None:
        job = VideoJob(path, outputs, frames=FRAMES, lanes=lanes, overwrite=True)
        run_video(job, detector, settings)

    tasks: dict[str, Task] = {
        "transcode": partial(_transcode, path, folder / "transcoded.mp4", default.output),
        "detect": partial(detect, model),
        "detect with lanes": partial(detect, model, lanes=LaneRequest(CAMERA)),
        "detect with svm": partial(detect, linear, settings=svm),
        "detect with answers": partial(detect, model, (*video, *files), answering),
        "detect only": partial(detect, model, ()),
        "detect only with svm": partial(detect, linear, (), svm),
    }
    return measure(tasks, rounds)


def _transcode(path: Path, out: Path, settings: OutputSettings) -> None:
    """Encode the planes of a video as they are decoded."""
    options = {"preset": settings.preset, "crf": str(settings.crf)}
    with av.open(str(path)) as source, av.open(str(out), "w") as target:
        stream = source.streams.video[0]
        stream.thread_type = "AUTO"
        encoder = target.add_stream("libx264", rate=stream.average_rate, options=options)
        encoder.width, encoder.height = stream.width, stream.height
        for frame in itertools.islice(source.decode(stream), FRAMES):
            frame.pict_type = PictureType.NONE  # the encoder chooses its own
            target.mux(encoder.encode(frame))
        target.mux(encoder.encode())


def seconds_of_video(path: Path) -> float:
    """Return the playing time of the measured frames."""
    with VideoReader(path, frames=FRAMES) as reader:
        count = sum(1 for _ in reader)
        return float(count / reader.info.rate)


def peak_memory(path: Path, folder: Path, *options: str) -> float:
    """Return the peak memory of a run of the program, MB."""
    code = (
        "from pathlib import Path\n"
        "from vdet.cli import main\n"
        "try:\n    main()\n"
        "except SystemExit as end:\n    assert not end.code\n"
        # not ru_maxrss: it keeps the peak of the process that started this one
        "status = Path('/proc/self/status').read_text()\n"
        "print(status.partition('VmHWM:')[2].split()[0])\n"
    )
    arguments = ["detect-video", str(path), str(folder / "memory.mp4"), "--overwrite", *options]
    command = [sys.executable, "-c", code, "--quiet", *arguments]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    return int(result.stdout.split()[-1]) / 1024


def seconds_of_program(path: Path, folder: Path, seconds: float) -> float:
    """Return how long the whole program takes for the first seconds of a video."""
    options = ["--end", str(seconds), "--overwrite"]
    arguments = ["detect-video", str(path), str(folder / "short.mp4"), *options]
    command = [sys.executable, "-m", "vdet", "--quiet", *arguments]
    began = time.perf_counter()
    subprocess.run(command, check=True)
    return time.perf_counter() - began

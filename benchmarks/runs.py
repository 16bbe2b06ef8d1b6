"""Whole runs of detect-video: wall time with and without outputs and lanes, and peak memory."""

import subprocess
import sys
from pathlib import Path

from benchmarks.material import ShippedConfig
from benchmarks.rounds import Task, measure
from vdet.config.counts import CountSettings, LineSettings, ZoneSettings
from vdet.config.draw import DrawSettings
from vdet.config.regions import RegionSettings, RegionsSettings
from vdet.config.schema import NetworkSettings
from vdet.config.section import Section
from vdet.detect.factory import load_detector
from vdet.detect.protocol import DetectorModel
from vdet.lanes.camera import CalibratedCamera
from vdet.lanes.road import LaneRequest
from vdet.media import VideoReader, VideoWriter
from vdet.pipeline.loop import VideoJob, run_video
from vdet.pipeline.sinks.protocol import Output
from vdet.pipeline.threads import prefetch, write_async

FRAMES = 250
CAMERA = CalibratedCamera(1280, 720, (1157, 1153), (668, 388), (-0.25, 0.0, 0.0, 0.0, 0.0), 0.0)
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


def run_times(path: Path, default: ShippedConfig, folder: Path, rounds: int) -> dict[str, float]:
    """Return the seconds that the first `FRAMES` frames take.

    Keys: `pass through` (read and written), `detect` (vehicles detected, drawn and written),
    `detect with lanes`, `detect with network`, `detect with answers` (`ANSWERS`, counts and records
    of vehicles too), `detect only` (nothing written).
    """
    out = folder / "out.mp4"
    model = default.detector
    network = load_detector(NetworkSettings())

    def pass_through() -> None:
        with (
            VideoReader(path, frames=FRAMES) as reader,
            VideoWriter(out, reader.info, default.settings.output) as writer,
            write_async(writer.write) as encode,
            prefetch(reader) as frames,
        ):
            for frame in frames:
                encode(frame)

    def detect(detector: DetectorModel = model, lanes: LaneRequest | None = None) -> None:
        outputs = (Output("video", out),)
        job = VideoJob(path, outputs, frames=FRAMES, lanes=lanes, overwrite=True)
        run_video(job, detector, default.settings)

    def detect_with_lanes() -> None:
        detect(lanes=LaneRequest(CAMERA))

    def detect_with_network() -> None:
        detect(network)

    answering = default.settings.model_copy(update=ANSWERS)
    answers = (Output("counts", folder / "counts.csv"), Output("summary", folder / "cars.csv"))

    def detect_with_answers() -> None:
        outputs = (Output("video", out), *answers)
        run_video(VideoJob(path, outputs, frames=FRAMES, overwrite=True), model, answering)

    def detect_only() -> None:
        run_video(VideoJob(path, frames=FRAMES), model, default.settings)

    tasks: dict[str, Task] = {
        "pass through": pass_through,
        "detect": detect,
        "detect with lanes": detect_with_lanes,
        "detect with network": detect_with_network,
        "detect with answers": detect_with_answers,
        "detect only": detect_only,
    }
    return measure(tasks, rounds)


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

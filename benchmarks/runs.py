"""Whole runs of detect-video: against passing frames through, real time, and for memory."""

import subprocess
import sys
from pathlib import Path

from benchmarks.material import Config
from benchmarks.rounds import measure
from vdet.pipeline import VideoJob, process_video
from vdet.stream import ahead, behind
from vdet.video import VideoReader, VideoWriter

FRAMES = 250


def run_times(path: Path, default: Config, folder: Path, rounds: int) -> dict[str, float]:
    """Return seconds for the first frames: passed through, detected and written, detected only."""
    out = folder / "out.mp4"

    def pass_through() -> None:
        with (
            VideoReader(path, frames=FRAMES) as reader,
            VideoWriter(out, reader.info, default.settings.output) as writer,
            behind(writer.write) as encode,
            ahead(reader) as frames,
        ):
            for frame in frames:
                encode(frame)

    def detect() -> None:
        process_video(VideoJob(path, out, frames=FRAMES), default.model, default.settings)

    def detect_only() -> None:
        process_video(VideoJob(path, frames=FRAMES), default.model, default.settings)

    subjects = {"pass through": pass_through, "detect": detect, "detect only": detect_only}
    return measure(subjects, rounds)


def seconds_of_video(path: Path) -> float:
    """Return how long the measured frames play."""
    with VideoReader(path, frames=FRAMES) as reader:
        count = sum(1 for _ in reader)
        return float(count / reader.info.rate)


def peak_memory(path: Path, folder: Path, *options: str) -> float:
    """Return the peak memory of a run of the program, MB."""
    code = (
        "import resource, sys\n"
        "from vdet.cli import main\n"
        "try:\n    main()\n"
        "except SystemExit as end:\n    assert not end.code\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)\n"
    )
    arguments = ["detect-video", str(path), str(folder / "memory.mp4"), "--overwrite", *options]
    command = [sys.executable, "-c", code, "--quiet", *arguments]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    return int(result.stdout.split()[-1]) / 1024

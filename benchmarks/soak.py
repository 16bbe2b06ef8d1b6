"""`make soak`: does memory, the number of files or the time a frame grow over 20,000 frames?"""

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from benchmarks.looping import loop_video
from benchmarks.material import video
from vdet.config.loading import find_config, load_settings
from vdet.detect.factory import load_detector
from vdet.pipeline.loop import VideoJob, run_video
from vdet.pipeline.sinks.protocol import Output

FRAMES = 20_000
MIN_FRAMES = 1000
WARM_UP = 500  # frames; nothing should grow after them
END = 50  # last frames; the reader has ended when they are processed
SAMPLE_INTERVAL = 50  # frames
MAX_MEMORY_GROWTH = 0.10
MIN_SPEED = 0.85  # of the last tenth, as a share of that of the first
TABLE_ROWS = 11


@dataclass(frozen=True)
class Sample:
    """The state of this process after a number of frames.

    `memory` and `peak` are MB: now, and the highest so far. `files` and `threads` are how many are
    open, and running.
    """

    frames: int
    seconds: float
    memory: float
    peak: float
    files: int
    threads: int


class Sampler:
    """Takes a sample every `SAMPLE_INTERVAL` frames."""

    def __init__(self) -> None:
        self.samples: list[Sample] = []
        self._frames = 0
        self._began = time.perf_counter()

    def __call__(self, _: int | None) -> Callable[[int], None]:
        """Take the first sample; this is the `progress` of a run."""
        self._began = time.perf_counter()
        self.samples.append(self._sample())
        return self._advance

    def _advance(self, frames: int) -> None:
        before = self._frames
        self._frames += frames
        if self._frames // SAMPLE_INTERVAL > before // SAMPLE_INTERVAL:
            self.samples.append(self._sample())
            if self._frames % 1000 < SAMPLE_INTERVAL:
                print(f"\r{self._frames} frames", end="", file=sys.stderr, flush=True)

    def _sample(self) -> Sample:
        status = Path("/proc/self/status").read_text(encoding="ascii")
        memory, peak = (_megabytes(status, field) for field in ("VmRSS:", "VmHWM:"))
        files, threads = (
            len(list(Path(f"/proc/self/{kind}").iterdir())) for kind in ("fd", "task")
        )
        seconds = time.perf_counter() - self._began
        return Sample(self._frames, seconds, memory, peak, files, threads)


def _megabytes(status: str, field: str) -> float:
    return int(status.partition(field)[2].split()[0]) / 1024


def find_growth(samples: Sequence[Sample]) -> list[str]:
    """Return a line about each thing that grew; `samples` are of a whole run."""
    warm = next(sample for sample in samples if sample.frames >= WARM_UP)
    later = [sample for sample in samples if sample.frames >= WARM_UP]
    found = []
    if (grown := later[-1].peak / warm.peak - 1) > MAX_MEMORY_GROWTH:
        found.append(
            f"peak memory grew by {grown:.1%} after the first {WARM_UP} frames, "
            f"from {warm.peak:.0f} to {later[-1].peak:.0f} MB"
        )
    before_end = [s for s in later if s.frames <= later[-1].frames - END]
    for name in ("files", "threads"):
        counts = sorted({getattr(sample, name) for sample in before_end})
        if len(counts) > 1:
            found.append(f"the number of {name} went from {counts[0]} to {counts[-1]}")
    first, last = speeds(samples)
    if last < MIN_SPEED * first:
        found.append(f"the last tenth ran at {last:.1f} frames/s, the first at {first:.1f}")
    return found


def speeds(samples: Sequence[Sample]) -> tuple[float, float]:
    """Return the frames/s of the first and of the last tenth of the run."""
    tenth = samples[-1].frames / 10
    first = next(sample for sample in samples if sample.frames >= tenth)
    last = next(sample for sample in samples if sample.frames >= 9 * tenth)
    return _speed(samples[0], first), _speed(last, samples[-1])


def _speed(start: Sample, end: Sample) -> float:
    return (end.frames - start.frames) / (end.seconds - start.seconds)


def table(samples: Sequence[Sample]) -> list[str]:
    """Return some of the samples as lines, each with the speed since the one before."""
    step = max(1, (len(samples) - 1) // (TABLE_ROWS - 1))
    shown = [*samples[:-1:step], samples[-1]]
    lines = ["frames  frames/s  memory MB  peak MB  files  threads"]
    for before, now in pairwise(shown):
        lines.append(
            f"{now.frames:6}  {_speed(before, now):8.1f}  {now.memory:9.0f}  {now.peak:7.0f}  "
            f"{now.files:5}  {now.threads:7}"
        )
    return lines


def main() -> None:
    """Run, and print a table and what grew; the exit code is 1 if anything did."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.soak", description=main.__doc__)
    parser.add_argument("--frames", type=int, default=FRAMES, help="at least 1000")
    frames = parser.parse_args().frames
    if frames < MIN_FRAMES:
        parser.error(f"--frames must be at least {MIN_FRAMES}")
    sampler = Sampler()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        loop_video(video(folder), folder / "long.mp4", frames)
        outputs = Output("video", folder / "out.mp4"), Output("tracks", folder / "out.jsonl")
        job = VideoJob(folder / "long.mp4", outputs, frames=frames)
        settings = load_settings(find_config("default"))
        model = load_detector(settings.detector)
        summary = run_video(job, model, settings, progress=sampler)
    print(file=sys.stderr)
    print("\n".join(table(sampler.samples)))
    first, last = speeds(sampler.samples)
    print(f"\n{summary.frames} frames in {summary.seconds:.0f} s, {summary.tracks} tracks")
    print(f"first tenth {first:.1f} frames/s, last tenth {last:.1f}")
    found = find_growth(sampler.samples)
    print("\n".join(found) or "nothing grew")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()

"""`make soak`: one run over 20,000 frames, watched for what creeps up: memory, files, time."""

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from benchmarks.looping import loop_video
from benchmarks.material import config, video
from vdet.pipeline.loop import VideoJob, run_video

FRAMES = 20_000
FEWEST = 1000
WARM = 500  # frames after which nothing should grow any more
ENDING = 50  # last frames, in which the reader has read all and gone
EVERY = 50  # frames between samples
MEMORY_GROWTH = 0.10
LEAST_SPEED = 0.85  # of the last tenth, against the first
ROWS = 11


@dataclass(frozen=True)
class Sample:
    """The state of the process after so many frames: memory in MB now and at most so far."""

    frames: int
    seconds: float
    memory: float
    peak: float
    files: int
    threads: int


class Watch:
    """Takes a sample every `EVERY` frames."""

    def __init__(self) -> None:
        self.samples: list[Sample] = []
        self._frames = 0
        self._began = time.perf_counter()

    def __call__(self, _: int | None) -> Callable[[int], None]:
        """Be the `progress` of a run."""
        self._began = time.perf_counter()
        self.samples.append(self._sample())
        return self._advance

    def _advance(self, frames: int) -> None:
        before = self._frames
        self._frames += frames
        if self._frames // EVERY > before // EVERY:
            self.samples.append(self._sample())
            if self._frames % 1000 < EVERY:
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


def complaints(samples: Sequence[Sample]) -> list[str]:
    """Return what crept up, or nothing; `samples` begin with the run and end with it."""
    warm = next(sample for sample in samples if sample.frames >= WARM)
    later = [sample for sample in samples if sample.frames >= WARM]
    found = []
    if (grown := later[-1].peak / warm.peak - 1) > MEMORY_GROWTH:
        found.append(
            f"peak memory grew by {grown:.1%} after the first {WARM} frames, from {warm.peak:.0f} "
            f"to {later[-1].peak:.0f} MB"
        )
    running = [s for s in later if s.frames <= later[-1].frames - ENDING]
    for name in ("files", "threads"):
        counts = sorted({getattr(sample, name) for sample in running})
        if len(counts) > 1:
            found.append(f"the number of {name} went from {counts[0]} to {counts[-1]}")
    first, last = tenths(samples)
    if last < LEAST_SPEED * first:
        found.append(f"the last tenth ran at {last:.1f} frames/s, the first at {first:.1f}")
    return found


def tenths(samples: Sequence[Sample]) -> tuple[float, float]:
    """Return frames/s over the first and the last tenth of the run."""
    tenth = samples[-1].frames / 10
    first = next(sample for sample in samples if sample.frames >= tenth)
    last = next(sample for sample in samples if sample.frames >= 9 * tenth)
    return _speed(samples[0], first), _speed(last, samples[-1])


def _speed(start: Sample, end: Sample) -> float:
    return (end.frames - start.frames) / (end.seconds - start.seconds)


def table(samples: Sequence[Sample]) -> list[str]:
    """Return a few of the samples as lines, with the speed since the one before."""
    step = max(1, (len(samples) - 1) // (ROWS - 1))
    shown = [*samples[:-1:step], samples[-1]]
    lines = ["frames  frames/s  memory MB  peak MB  files  threads"]
    for before, now in pairwise(shown):
        lines.append(
            f"{now.frames:6}  {_speed(before, now):8.1f}  {now.memory:9.0f}  {now.peak:7.0f}  "
            f"{now.files:5}  {now.threads:7}"
        )
    return lines


def main() -> None:
    """Run, print the table and the verdict; the exit code is 1 where something crept up."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.soak", description=main.__doc__)
    parser.add_argument("--frames", type=int, default=FRAMES, help="at least 1000")
    frames = parser.parse_args().frames
    if frames < FEWEST:
        parser.error(f"--frames must be at least {FEWEST}")
    watch = Watch()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        loop_video(video(folder), folder / "long.mp4", frames)
        job = VideoJob(
            folder / "long.mp4", folder / "out.mp4", tracks=folder / "out.jsonl", frames=frames
        )
        default = config("default")
        summary = run_video(job, default.model, default.settings, progress=watch)
    print(file=sys.stderr)
    print("\n".join(table(watch.samples)))
    first, last = tenths(watch.samples)
    print(f"\n{summary.frames} frames in {summary.seconds:.0f} s, {summary.tracks} tracks")
    print(f"first tenth {first:.1f} frames/s, last tenth {last:.1f}")
    found = complaints(watch.samples)
    print("\n".join(found) or "nothing crept up")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()

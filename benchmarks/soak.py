"""`make soak`: memory, open files, threads and time of a long run must not grow.

One run is over 20,000 frames of a road video, the other over 200,000 of a drawn road before a fixed
camera, which are not searched: what a run keeps of each frame shows in its memory.
"""

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np

from benchmarks.conditions import SETTINGS as FIXED
from benchmarks.material import find_video
from vdet.boxes import NO_BOXES
from vdet.config.schema import OutputSettings, Settings
from vdet.detect.detectors import as_model
from vdet.media import Frame, Picture, VideoInfo
from vdet.media.writer import VideoWriter
from vdet.run.loop import Parts
from vdet.run.sinks import Output
from vdet.run.video import Run, run_video

FRAMES, FIXED_FRAMES = 20_000, 200_000
FIXED_GROWTH = 2.0  # MB in the second half of the frames of a fixed camera
MIN_FRAMES = 1000
WARM_UP_FRAMES = 500  # frames after which nothing may grow
ENDING = 50  # last frames, in which the reader may have closed its files and threads
SAMPLE_INTERVAL = 50  # frames between samples
MEMORY_GROWTH = 0.10
MIN_SPEED_RATIO = 0.85  # of the last tenth, against the first
REPORT_INTERVAL = 2000  # frames between printed samples


@dataclass(frozen=True)
class Sample:
    """The state of the process after `frames` frames.

    `seconds` since the first frame; `memory` and `peak` in MB, now and at most so far; counts of
    open files and of threads.
    """

    frames: int
    seconds: float
    memory: float
    peak: float
    files: int
    threads: int


class ResourceMonitor:
    """Takes a sample every `SAMPLE_INTERVAL` frames; it is the `steps` of a run."""

    def __init__(self) -> None:
        self.samples: list[Sample] = []
        self._frames = 0
        self._began = time.perf_counter()

    def __call__(self, _: str, __: int | None) -> Callable[[int], None]:
        """Take the first sample; return what is called with the number of frames done."""
        self._began = time.perf_counter()
        self.samples.append(self._sample())
        return self._advance

    def _advance(self, frames: int) -> None:
        before = self._frames
        self._frames += frames
        if self._frames // SAMPLE_INTERVAL > before // SAMPLE_INTERVAL:
            sample = self._sample()
            self.samples.append(sample)
            if self._frames // REPORT_INTERVAL > before // REPORT_INTERVAL:
                print(sample, flush=True)

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
    """Say what grew in a run, a line each; the first and last sample are its start and its end."""
    warm = next(sample for sample in samples if sample.frames >= WARM_UP_FRAMES)
    later = [sample for sample in samples if sample.frames >= WARM_UP_FRAMES]
    found = []
    if (growth := later[-1].peak / warm.peak - 1) > MEMORY_GROWTH:
        found.append(
            f"peak memory grew by {growth:.1%} after the first {WARM_UP_FRAMES} frames, "
            f"from {warm.peak:.0f} to {later[-1].peak:.0f} MB"
        )
    running = [s for s in later if s.frames <= later[-1].frames - ENDING]
    middle = len(running) // 2
    for name in ("files", "threads"):  # a search has a thread of its own, so the number varies
        counts = [getattr(sample, name) for sample in running]
        first, second = max(counts[:middle]), max(counts[middle:])
        if second > first:
            found.append(f"the maximum number of {name} grew from {first} to {second}")
    first, last = tenths(samples)
    if last < MIN_SPEED_RATIO * first:
        found.append(f"the last tenth ran at {last:.1f} frames/s, the first at {first:.1f}")
    return found


def find_leak(samples: Sequence[Sample]) -> list[str]:
    """Say how much memory the second half of a run added, if that is too much."""
    tenth = max(1, len(samples) // 10)
    ends = [
        statistics.median(s.memory for s in samples[at - tenth : at])
        for at in (len(samples) // 2 + tenth, len(samples) - 1)
    ]
    growth = ends[1] - ends[0]
    print(f"memory of the second half: {growth:+.2f} MB")
    return [f"memory grew by {growth:.1f} MB in the second half"] if growth > FIXED_GROWTH else []


def tenths(samples: Sequence[Sample]) -> tuple[float, float]:
    """Return the frames/s of the first and of the last tenth of the run."""
    tenth = samples[-1].frames / 10
    first = next(sample for sample in samples if sample.frames >= tenth)
    last = next(sample for sample in samples if sample.frames >= 9 * tenth)
    return _speed(samples[0], first), _speed(last, samples[-1])


def _speed(start: Sample, end: Sample) -> float:
    return (end.frames - start.frames) / (end.seconds - start.seconds)


def loop_video(source: Path, target: Path, frames: int) -> None:
    """Repeat the packets of a video until it has at least `frames` frames; sound is left out."""
    with av.open(str(source)) as once:
        length = sum(packet.dts is not None for packet in once.demux(video=0))
    parts = target.with_suffix(".txt")
    parts.write_text(f"file '{source.absolute()}'\n" * -(-frames // length), encoding="utf-8")
    joined = av.open(str(parts), format="concat", options={"safe": "0"})
    with joined as reader, av.open(str(target), "w") as output:
        stream = output.add_stream_from_template(reader.streams.video[0])
        for packet in reader.demux(video=0):
            if packet.dts is not None:
                packet.stream = stream
                output.mux(packet)


def write_fixed(folder: Path) -> Path:
    """Draw a minute of a road with noise; a square crosses it every ten seconds."""
    path, rng = folder / "fixed.mp4", np.random.default_rng(0)
    road = cv2.GaussianBlur(rng.integers(0, 256, (180, 320, 3), np.uint8), (0, 0), 2)
    info = VideoInfo(path, 320, 180, Fraction(25), Fraction(1, 25))
    with VideoWriter(path, info, OutputSettings(preset="ultrafast")) as writer:
        for index in range(60 * 25):
            image = road + rng.integers(0, 4, road.shape, np.uint8)
            left = 2 * (index % 250)
            image[110:130, left : left + 30] = 255
            writer.write(Frame(index, Fraction(index, 25), Picture(image.astype(np.uint8))))
    return path


def main() -> None:
    """Run, print samples and what grew; the exit code is 1 where something grew."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.soak", description=main.__doc__)
    parser.add_argument("--frames", type=int, help="at least 1000")
    parser.add_argument("--fixed", action="store_true", help="of a fixed camera, without search")
    options = parser.parse_args()
    frames = options.frames or (FIXED_FRAMES if options.fixed else FRAMES)
    if frames < MIN_FRAMES:
        parser.error(f"--frames must be at least {MIN_FRAMES}")
    monitor = ResourceMonitor()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        source = write_fixed(folder) if options.fixed else find_video(folder)
        loop_video(source, folder / "long.mp4", frames)
        outputs = [Output("video", folder / "out.mp4"), Output("tracks", folder / "out.jsonl")]
        settings, parts = Settings(), None
        if options.fixed:
            outputs, settings, parts = outputs[1:], FIXED, Parts(as_model(lambda _: NO_BOXES))
        run = Run(folder / "long.mp4", tuple(outputs), settings, frames=frames)
        totals = run_video(run, parts, progress=monitor)
    first, last = tenths(monitor.samples)
    print(f"\n{totals.frames} frames in {totals.seconds:.0f} s, {totals.tracks} tracks")
    print(f"first tenth {first:.1f} frames/s, last tenth {last:.1f}")
    grown = find_leak(monitor.samples) if options.fixed else find_growth(monitor.samples)
    print("\n".join(grown) or "nothing grew")
    sys.exit(1 if grown else 0)


if __name__ == "__main__":
    main()

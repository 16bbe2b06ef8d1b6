"""Counting at lines and in zones, against detecting and following the vehicles of the same frames.

`python -m benchmarks.counting` prints both times.
"""

import tempfile
from pathlib import Path

from benchmarks.material import ShippedConfig, find_video, shipped_config
from benchmarks.rounds import Task, measure
from vdet.config.counts import CountSettings
from vdet.count.counter import count_events
from vdet.count.layout import Layout, lay_out
from vdet.media import VideoReader
from vdet.pipeline.loop import follow_frames, peek
from vdet.pipeline.threads import single_threaded_libraries
from vdet.track.track import FrameTracks

FRAMES = 120
START = 690  # of the project video: two vehicles are near
SETTINGS = CountSettings.model_validate(
    {
        "lines": [
            {"name": f"row {row}", "start": [0, row], "end": [1, row]} for row in (0.65, 0.7, 0.75)
        ],
        "zones": [
            {"name": "near", "points": [[0.5, 0.6], [1, 0.6], [1, 1], [0.7, 1]]},
            {"name": "left", "points": [[0, 0.6], [0.5, 0.6], [0.3, 1], [0, 1]]},
        ],
    }
)
"""Three lines and two zones."""


def counting_times(path: Path, default: ShippedConfig, rounds: int) -> dict[str, float]:
    """Return seconds a frame, on one thread.

    Keys: `detect` (decoded frames searched and followed), `count` (their tracks counted).
    """
    with VideoReader(path) as reader:
        info = reader.info
        frames = [frame for frame in reader if START <= frame.index < START + FRAMES]
    if not frames:  # a shorter video
        with VideoReader(path, frames=FRAMES) as reader:
            frames = list(reader)
    found: list[FrameTracks] = []

    def detect() -> None:
        images, read = peek(frames)
        detector = default.detector.for_video(info.width, info.height, images)
        results = follow_frames(read, detector, default.settings, info)
        found[:] = [result.frame_tracks for result in results]

    layout: Layout = lay_out(SETTINGS, info.width, info.height)
    tasks: dict[str, Task] = {"detect": detect, "count": lambda: count_events(found, layout)}
    with single_threaded_libraries():
        times = measure(tasks, rounds)
    return {name: seconds / len(frames) for name, seconds in times.items()}


def main() -> None:
    """Print the times and their ratio."""
    with tempfile.TemporaryDirectory() as folder:
        times = counting_times(find_video(Path(folder)), shipped_config("default"), 5)
    shown = ", ".join(f"{name} {1000 * seconds:.3f} ms" for name, seconds in times.items())
    print(f"{shown} a frame; ratio {times['count'] / times['detect']:.4f}")


if __name__ == "__main__":
    main()

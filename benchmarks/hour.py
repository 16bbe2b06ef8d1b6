"""`vdet count` on the tracks of an hour: seconds for 1.2 million boxes at ten lines."""

import tempfile
from pathlib import Path

import numpy as np

from benchmarks.rounds import seconds_of
from vdet.boxes import Box
from vdet.labels.formats import TrackWriter, format_for
from vdet.labels.label import SourceVideo
from vdet.track.track import FrameTracks, Track

RATE, SECONDS, BOXES = 25, 3600, 1_200_000
WIDTH, HEIGHT = 1280, 720


def main() -> None:
    """Print the time of each format."""
    for suffix in (".csv", ".jsonl"):
        with tempfile.TemporaryDirectory() as folder:
            print(f"{suffix}: {BOXES:,} boxes, {seconds_of_count(Path(folder), suffix):.1f} s")


def seconds_of_count(folder: Path, suffix: str) -> float:
    """Return the processor time of the whole program for the tracks of an hour.

    It is one thread: on a machine without other work, this is how long it takes.
    """
    tracks, lines = folder / f"hour{suffix}", folder / "lines.yaml"
    write_hour(tracks)
    lines.write_text(_lines(), encoding="utf-8")
    return seconds_of("-m", "vdet", "--quiet", "count", str(tracks), "-c", str(lines))


def _lines() -> str:
    rows = [((100, y), (1180, y + 20)) for y in (300, 350, 400, 470, 560)]
    columns = [((x, 200), (x + 20, 700)) for x in (200, 400, 640, 850, 1080)]
    lines = [
        f"    - {{name: line {number}, start: {list(start)}, end: {list(end)}}}\n"
        for number, (start, end) in enumerate(rows + columns)
    ]
    camera = f"camera: {{size: [{WIDTH}, {HEIGHT}]}}\n"
    return camera + "traffic:\n  lines:\n" + "".join(lines)


def write_hour(path: Path, seed: int = 0) -> None:
    """Write vehicles that cross the frame in all directions, thirteen at once."""
    rng, frames, left, number = np.random.default_rng(seed), RATE * SECONDS, BOXES, 0
    tracks: list[list[Track]] = [[] for _ in range(frames)]
    while left:
        number, life = number + 1, min(left, int(rng.integers(100, 400)))
        first, angle = int(rng.integers(0, frames - life)), rng.uniform(0, 2 * np.pi)
        way = np.linspace(-300, 300, life)[:, None] * (np.cos(angle), np.sin(angle) / 2)
        feet = rng.uniform((300, 350), (980, 600)) + way + rng.normal(0, 0.5, (life, 2))
        for index, (x, y) in enumerate(feet.tolist(), first):
            height = 20 + y / 12
            box = Box(x - 0.7 * height, y - height, x + 0.7 * height, y)
            tracks[index].append(Track(number, box, 0.9, "detected", "car", (x, y)))
        left -= life
    form = format_for(path)
    assert form is not None
    with path.open("wb") as file:
        writer = TrackWriter(form, file, SourceVideo("hour.mp4", WIDTH, HEIGHT))
        for index, shown in enumerate(tracks):
            writer.write(FrameTracks(index, index / RATE, tuple(shown)))
        writer.end()


if __name__ == "__main__":
    main()

"""The table of `make bench`."""

import argparse
import json
import os
import platform
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np

from benchmarks.corrections import cost_of_thousands
from benchmarks.material import find_video, read_pictures, shipped_svm
from benchmarks.runs import IMPORTS, peak_memory, run_times, seconds_of_count, start_times
from benchmarks.searches import search_times, times_by_height
from vdet.workers import limit_library_threads


@dataclass(frozen=True)
class Measurement:
    """A measured ratio, or seconds or MB, with its bound, the aim, and what it is made of."""

    name: str
    value: float
    must: str
    aim: str
    detail: str


def main() -> None:
    """Measure everything, print the table, write it as JSON."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=main.__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--json", type=Path, default=Path("bench.json"))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = measure_all(Path(folder), options.rounds)
    machine = f"{_cpu()}, {os.cpu_count()} cores; OpenCV {cv2.__version__}, NumPy {np.__version__}"
    print("| | measured | must | aim | |\n|---|---|---|---|---|")
    for row in rows:
        print(f"| {row.name} | {row.value:.2f} | {row.must} | {row.aim} | {row.detail} |")
    print(f"\n{machine}; medians of {options.rounds} interleaved rounds")
    record = {"machine": machine, "rounds": options.rounds, "rows": [asdict(row) for row in rows]}
    options.json.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")


ROWS = f"""\
patch / dense, windows of seed.yaml | seed patch | seed dense | ≥ 2 | 4
detectMultiScale / dense | detectMultiScale | svm dense | ≥ 3 | 8
dense / decoding to planes | svm dense | decoding | ≤ 1.2 | 0.8
network / decoding to planes | network detection | decoding | – | –
network / svm.yaml, a frame | network detection | svm detection | ≤ 2.7 | 2.1
detect-video / plain transcode | detect | transcode | ≤ 1.5 | 1.3
detect-video -c svm / plain transcode | detect with svm | transcode | ≤ 1.25 | –
detect-video --lanes with a lens / without | detect with lanes | detect | ≤ 1.25 | –
detect-video with regions, counts and trails / without | detect with answers | detect | ≤ 1.03 | –
detect-video --flows with a clock / without | detect with flows | detect | ≤ 1.03 | –
length / detect-video --no-video | played | detect only | ≥ 7 | 10
length / detect-video --no-video -c svm | played | detect only with svm | – | –
dense search of a frame, 1080p / 720p | 1080 | 720 | ≤ 1.6 | –
dense search of a frame, 2160p / 720p | 2160 | 720 | ≤ 4 | –
vdet --help / python -c '{IMPORTS}' | help | imports | ≤ 0.8 | 0.5
detect-image, one image / the same | picture | imports | ≤ 2.5 | 2.0
a second of video / PyAV alone, processor time | busy second | busy plain second | ≤ 2.0 | 1.5
"""
"""Ratios: the name, the two tasks whose times are divided, the bound, and the aim."""


def measure_all(folder: Path, rounds: int) -> list[Measurement]:
    path = find_video(folder)
    svm, seed = shipped_svm("svm"), shipped_svm("seed")
    pictures = read_pictures(path)
    print(f"measuring on {path.name} …", file=sys.stderr)
    limit_library_threads()
    of_frames = search_times(path, pictures, svm, seed, rounds)
    of_frames |= times_by_height(pictures, svm, rounds)
    starts = start_times(path, folder, rounds)
    times = {
        **{name: (seconds, 0.0) for name, seconds in of_frames.items()},
        **run_times(path, folder, rounds),
        **starts,
        **{f"busy {name}": (busy, 0.0) for name, (_, busy) in starts.items()},
    }
    hour = seconds_of_count(folder)
    corrected, corrected_memory = cost_of_thousands(folder)
    whole, first = (peak_memory(path, folder, *extra) for extra in ((), ("--frames", "40")))
    parts = f"{whole:.0f} and {first:.0f} MB"
    name = "peak memory, whole video"
    return [
        *(_ratio(times, row) for row in ROWS.splitlines()),
        Measurement("vdet count, tracks of an hour", hour, "≤ 20", "8", "1.2 million boxes"),
        Measurement("5,000 corrections over an hour", corrected, "≤ 1", "–", "seconds"),
        Measurement("the same, memory at most", corrected_memory, "≤ 200", "–", "MB"),
        Measurement(name, whole, "≤ 290", "200", "MB"),
        Measurement(f"{name} / its first 40 frames", whole / first, "≤ 1.15", "–", parts),
    ]


def _ratio(times: Mapping[str, tuple[float, float]], row: str) -> Measurement:
    """Return the ratio of two tasks; `times` are seconds of wall time and of processor time."""
    name, over, under, must, aim = row.split(" | ")
    (wall, busy), (other_wall, other_busy) = times[over], times[under]
    detail = f"{1000 * wall:.1f} and {1000 * other_wall:.1f} ms"
    if other_busy and busy:
        detail += f"; processor time: {busy / other_busy:.2f}, {busy:.2f} and {other_busy:.2f} s"
    return Measurement(name, wall / other_wall, must, aim, detail)


def _cpu() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
        return next(line.partition(": ")[2] for line in text.splitlines() if "model name" in line)
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


if __name__ == "__main__":
    main()

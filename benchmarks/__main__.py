"""The table of `make bench`."""

import argparse
import json
import os
import platform
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np

from benchmarks.material import find_video, read_pictures, shipped_svm
from benchmarks.runs import (
    IMPORTS,
    peak_memory,
    run_times,
    seconds_of_count,
    seconds_of_video,
    start_times,
)
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
    print("\n".join(_table(rows)))
    print(f"\n{machine}; medians of {options.rounds} interleaved rounds")
    record = {"machine": machine, "rounds": options.rounds, "rows": [asdict(row) for row in rows]}
    options.json.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")


def measure_all(folder: Path, rounds: int) -> list[Measurement]:
    path = find_video(folder)
    svm, seed = shipped_svm("svm"), shipped_svm("seed")
    pictures = read_pictures(path)
    print(f"measuring on {path.name} …", file=sys.stderr)
    limit_library_threads()
    searched = search_times(path, pictures, svm, seed, rounds)
    by_height = times_by_height(pictures, svm, rounds)
    ran = run_times(path, folder, rounds)
    started = start_times(path, folder, rounds)
    hour = seconds_of_count(folder, ".csv")
    memory = [peak_memory(path, folder, *extra) for extra in ((), ("--frames", "40"))]
    whole, first = memory
    return [
        *_search_rows(searched),
        *_run_rows(ran, seconds_of_video(path)),
        *_size_rows(by_height),
        *_start_rows(started),
        Measurement("vdet count, tracks of an hour", hour, "≤ 20", "8", "1.2 million boxes"),
        Measurement("peak memory, whole video", whole, "≤ 260", "200", "MB"),
        Measurement(
            "peak memory, whole video / its first 40 frames", whole / first, "≤ 1.15", "–",
            f"{whole:.0f} and {first:.0f} MB",
        ),
    ]  # fmt: skip


def _search_rows(times: dict[str, float]) -> list[Measurement]:
    def row(name: str, over: str, under: str, must: str, aim: str = "–") -> Measurement:
        detail = f"{1000 * times[over]:.1f} and {1000 * times[under]:.1f} ms a frame"
        return Measurement(name, times[over] / times[under], must, aim, detail)

    dense, decoding = "svm dense", "decoding"
    return [
        row("patch / dense, windows of seed.yaml", "seed patch", "seed dense", "≥ 2", "4"),
        row("detectMultiScale / dense", "detectMultiScale", dense, "≥ 3", "8"),
        row("dense / decoding to planes", f"{dense} beside decoding", decoding, "≤ 1.2", "0.8"),
        row("network / decoding to planes", "network beside decoding", decoding, "–"),
        row(
            "network / svm.yaml, detection of a frame",
            "network detection", "svm detection", "≤ 1.8", "1.4",
        ),
    ]  # fmt: skip


Times = Mapping[str, tuple[float, float]]
"""Seconds of wall time and of processor time of each task."""


def _row_of(times: Times) -> Callable[..., Measurement]:
    """Return a function that makes a row of the ratio of two tasks."""

    def row(name: str, over: str, under: str, must: str, aim: str = "–") -> Measurement:
        (wall, busy), (other_wall, other_busy) = times[over], times[under]
        detail = f"{wall:.2f} and {other_wall:.2f} s"
        if other_busy and busy:
            detail += (
                f"; processor time: {busy / other_busy:.2f}, {busy:.2f} and {other_busy:.2f} s"
            )
        return Measurement(name, wall / other_wall, must, aim, detail)

    return row


def _start_rows(times: Times) -> list[Measurement]:
    row, busy_row = _row_of(times), _row_of({name: (busy, 0) for name, (_, busy) in times.items()})
    return [
        row(f"vdet --help / python -c '{IMPORTS}'", "help", "imports", "≤ 0.8", "0.5"),
        row("detect-image, one image / the same", "picture", "imports", "≤ 2.5", "2.0"),
        busy_row(
            "one second of video / PyAV alone, processor time",
            "second", "plain second", "≤ 2.0", "1.5",
        ),
    ]  # fmt: skip


def _run_rows(times: Times, played: float) -> list[Measurement]:
    row = _row_of({**times, "played": (played, 0.0)})
    return [
        row("detect-video / plain transcode", "detect", "transcode", "≤ 1.15", "1.05"),
        row("detect-video -c svm / plain transcode", "detect with svm", "transcode", "≤ 1.25"),
        row("detect-video --lanes --camera / without", "detect with lanes", "detect", "≤ 1.25"),
        row(
            "detect-video with regions, counts, records and trails / without",
            "detect with answers", "detect", "≤ 1.03",
        ),
        row(
            "detect-video --flows --begin --ground / without",
            "detect with flows", "detect", "≤ 1.03",
        ),
        row("length / detect-video --no-video", "played", "detect only", "≥ 7", "10"),
        row("length / detect-video --no-video -c svm", "played", "detect only with svm", "–"),
    ]  # fmt: skip


def _size_rows(times: dict[int, float]) -> list[Measurement]:
    bounds = {1080: "≤ 1.6", 2160: "≤ 4"}
    return [
        Measurement(
            f"dense search of a frame, {height}p / 720p", times[height] / times[720], must, "–",
            f"{1000 * times[height]:.1f} and {1000 * times[720]:.1f} ms",
        )
        for height, must in bounds.items()
    ]  # fmt: skip


def _table(rows: Sequence[Measurement]) -> list[str]:
    lines = ["| | measured | must | aim | |", "|---|---|---|---|---|"]
    return lines + [
        f"| {row.name} | {row.value:.2f} | {row.must} | {row.aim} | {row.detail} |" for row in rows
    ]


def _cpu() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
        return next(line.partition(": ")[2] for line in text.splitlines() if "model name" in line)
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


if __name__ == "__main__":
    main()

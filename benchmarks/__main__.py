"""The table of `make bench`."""

import argparse
import itertools
import json
import os
import platform
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np

from benchmarks.material import find_video, read_frames, shipped_config
from benchmarks.runs import peak_memory, run_times, seconds_of_video
from benchmarks.searches import search_times, times_per_megapixel
from vdet.pipeline.threads import single_threaded_libraries


@dataclass(frozen=True)
class Measurement:
    """A measured ratio, the bound that it must keep, the aim, and the times that it is made of."""

    name: str
    ratio: float
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
    default, seed = shipped_config("default"), shipped_config("seed")
    images = read_frames(path)
    print(f"measuring on {path.name} …", file=sys.stderr)
    with single_threaded_libraries():
        searched = search_times(path, images, default, seed, rounds)
        by_height = times_per_megapixel(images, default, rounds)
    ran = run_times(path, default, folder, rounds)
    memory = [peak_memory(path, folder, *extra) for extra in ((), ("--frames", "40"))]
    return [
        *_search_rows(searched),
        *_run_rows(ran, seconds_of_video(path)),
        _size_row(by_height),
        Measurement(
            "peak memory, whole video / its first 40 frames",
            memory[0] / memory[1], "≤ 1.15", "–",
            f"{memory[0]:.0f} and {memory[1]:.0f} MB",
        ),
    ]  # fmt: skip


def _search_rows(times: dict[str, float]) -> list[Measurement]:
    dense = times["default dense"]
    beside = times["default dense beside decoding"]

    def against(name: str, reference: str, fast: float, must: str, aim: str) -> Measurement:
        detail = f"{1000 * times[reference]:.1f} and {1000 * fast:.1f} ms a frame"
        return Measurement(name, times[reference] / fast, must, aim, detail)

    return [
        against("patch (seed.yaml) / dense (default.yaml)", "seed patch", dense, "≥ 20", "60"),
        against("patch / dense, both seed.yaml", "seed patch", times["seed dense"], "≥ 2", "4"),
        against("detectMultiScale / dense", "detectMultiScale", dense, "≥ 3", "8"),
        Measurement(
            "dense / decoding a frame", beside / times["decoding"], "≤ 2.5", "1",
            f"{1000 * beside:.1f} and {1000 * times['decoding']:.1f} ms",
        ),
        Measurement(
            "network / default, detection of a frame",
            times["network detection"] / times["default detection"], "≤ 1.2", "0.8",
            f"{1000 * times['network detection']:.1f} and "
            f"{1000 * times['default detection']:.1f} ms",
        ),
    ]  # fmt: skip


def _run_rows(times: dict[str, float], played: float) -> list[Measurement]:
    through, detect, only = times["pass through"], times["detect"], times["detect only"]
    lanes = times["detect with lanes"]
    return [
        Measurement(
            "detect-video / passing frames through", detect / through, "≤ 1.4", "1.1",
            f"{detect:.2f} and {through:.2f} s for {played:.0f} s of video",
        ),
        Measurement(
            "detect-video --lanes --camera / without", lanes / detect, "≤ 1.35", "–",
            f"{lanes:.2f} and {detect:.2f} s",
        ),
        Measurement(
            "detect-video -c net / detect-video", times["detect with network"] / detect, "≤ 1.1",
            "1", f"{times['detect with network']:.2f} and {detect:.2f} s",
        ),
        Measurement(
            "detect-video with regions, counts, records and trails / without",
            times["detect with answers"] / detect, "≤ 1.03", "–",
            f"{times['detect with answers']:.2f} and {detect:.2f} s",
        ),
        Measurement(
            "video's length / detect-video --no-video", played / only, "≥ 3", "6",
            f"{played:.1f} and {only:.2f} s",
        ),
    ]  # fmt: skip


def _size_row(times: dict[int, float]) -> Measurement:
    """Windows scale with the frame, so the time a megapixel does not grow with the frame."""
    detail = ", ".join(f"{height}p {1000 * t:.1f}" for height, t in times.items())
    growth = max(after / before for before, after in itertools.pairwise(times.values()))
    name = "dense per megapixel, a size / the next smaller one, at most"
    return Measurement(name, growth, "≤ 1.5", "–", f"{detail} ms")


def _table(rows: Sequence[Measurement]) -> list[str]:
    lines = ["| | ratio | must | aim | |", "|---|---|---|---|---|"]
    return lines + [
        f"| {row.name} | {row.ratio:.2f} | {row.must} | {row.aim} | {row.detail} |" for row in rows
    ]


def _cpu() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
        return next(line.partition(": ")[2] for line in text.splitlines() if "model name" in line)
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


if __name__ == "__main__":
    main()

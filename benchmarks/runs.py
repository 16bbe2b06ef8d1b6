"""Whole runs of the program: time with and without outputs and lanes, peak memory, and counting."""

import json
import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from benchmarks.material import transcode
from benchmarks.rounds import Task, measure_both, seconds_of
from vdet.boxes import Box
from vdet.config.loading import find_config, load_settings
from vdet.config.schema import Settings, SvmSettings
from vdet.detect.detectors import DetectorModel, load_detector
from vdet.labels.label import SourceVideo, TrackWriter, format_for
from vdet.media.reader import VideoReader
from vdet.run.loop import Parts
from vdet.run.sinks import Output
from vdet.run.video import Run, run_video
from vdet.track.track import FrameTracks, Track

FRAMES = 250
TRAFFIC = {
    "lines": [
        {"name": f"row {row}", "start": (0, row), "end": (1, row)} for row in (0.65, 0.7, 0.75)
    ],
    "zones": [
        {"name": "near", "points": [(0.5, 0.6), (1, 0.6), (1, 1), (0.7, 1)]},
        {"name": "left", "points": [(0, 0.6), (0.5, 0.6), (0.3, 1), (0, 1)]},
    ],
}
EVERYTHING = {"name": "all", "points": [(0, 0), (1, 0), (1, 1), (0, 1)]}  # leaves nothing out
GROUND = [  # the numbers do not change the time of speeds
    {"pixel": pixel, "metres": metres}
    for pixel, metres in (
        ((0.15, 0.95), (0, 0)), ((0.85, 0.95), (7.4, 0)),
        ((0.58, 0.62), (7.4, 30)), ((0.44, 0.62), (0, 30)),
    )
]  # fmt: skip


def run_times(path: Path, folder: Path, rounds: int) -> dict[str, tuple[float, float]]:
    """Return the seconds of wall time and of processor time of the first `FRAMES` frames.

    Keys: `transcode` (decoded, and encoded with the same preset and quality), `detect` (vehicles
    detected, drawn and written), `detect with lanes`, `detect with svm`, `detect with answers`
    (a region, trails, counts and records of vehicles too), `detect with flows` (flows by the clock,
    and speeds, at the lines of `TRAFFIC`), `detect only` and `detect only with svm` (nothing
    written), `played` (the length of these frames).
    """
    out = folder / "out.mp4"
    video = (Output("video", out),)
    files = Output("counts", folder / "counts.csv"), Output("vehicles", folder / "cars.csv")
    default, svm = Settings(), Settings(detector=SvmSettings())
    lanes = load_settings([find_config("project-camera")], ["lanes.enabled=true"])
    regions = {"regions": [EVERYTHING], "draw": {"trails": 2}}
    clock = {"camera": {"ground": GROUND}, "input": {"begin": "2026-05-01 07:00"}}
    answering, counting = (
        Settings.model_validate({"traffic": TRAFFIC} | more) for more in (regions, clock)
    )
    traffic = Output("flows", folder / "flows.csv"), Output("counts", folder / "counts.csv")
    model, linear = load_detector(default.detector), load_detector(svm.detector)

    def detect(
        detector: DetectorModel, outputs: tuple[Output, ...] = video, settings: Settings = default
    ) -> None:
        run_video(Run(path, outputs, settings, frames=FRAMES, overwrite=True), Parts(detector))

    tasks: dict[str, Task] = {
        "transcode": partial(transcode, path, folder / "transcoded.mp4", FRAMES),
        "detect": partial(detect, model),
        "detect with lanes": partial(detect, model, settings=lanes),
        "detect with svm": partial(detect, linear, settings=svm),
        "detect with answers": partial(detect, model, (*video, *files), answering),
        "detect with flows": partial(detect, model, (*video, *traffic), counting),
        "detect only": partial(detect, model, ()),
        "detect only with svm": partial(detect, linear, (), svm),
    }
    with VideoReader(path, frames=FRAMES) as reader:
        played = float(sum(1 for _ in reader) / reader.info.rate)
    return measure_both(tasks, rounds) | {"played": (played, 0.0)}


IMPORTS = "import numpy, cv2, av"


def start_times(path: Path, folder: Path, rounds: int) -> dict[str, tuple[float, float]]:
    """Return the seconds of wall time and of processor time of whole programs.

    Keys: `imports` (Python with `IMPORTS`), `help`, `picture` (vehicles in one picture), `second`
    (one second of a video), `plain second` (decoded and encoded by PyAV alone).
    """
    picture = folder / "picture.jpg"
    with VideoReader(path, frames=1) as reader:
        cv2.imwrite(str(picture), next(iter(reader)).image)
    plain = (
        "from pathlib import Path; from benchmarks.material import transcode; "
        f"transcode(Path({str(path)!r}), Path({str(folder / 'plain.mp4')!r}), 25)"
    )
    video = ["detect-video", str(path), str(folder / "short.mp4"), "--end", "1", "--overwrite"]
    commands = {
        "imports": ["-c", IMPORTS],
        "help": ["-m", "vdet", "--help"],
        "picture": ["-m", "vdet", "detect-image", str(picture)],
        "second": ["-m", "vdet", "--quiet", *video],
        "plain second": ["-c", plain],
    }
    environment = {**os.environ, "PYTHONPYCACHEPREFIX": str(folder / "bytecode")}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # programs that are installed have bytecode
    run = partial(subprocess.run, check=True, capture_output=True, env=environment)
    tasks: dict[str, Task] = {
        name: partial(run, [sys.executable, *command]) for name, command in commands.items()
    }
    return measure_both(tasks, rounds)


def peak_memory(path: Path, folder: Path, *options: str) -> float:
    """Return the peak memory of a run of the program, MB."""
    code = (
        "from pathlib import Path\n"
        "from vdet.cli import main\n"
        "assert main() == 0\n"
        # not ru_maxrss: it keeps the peak of the process that started this one
        "status = Path('/proc/self/status').read_text()\n"
        "print(status.partition('VmHWM:')[2].split()[0])\n"
    )
    arguments = ["detect-video", str(path), str(folder / "memory.mp4"), "--overwrite", *options]
    command = [sys.executable, "-c", code, "--quiet", *arguments]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    return int(result.stdout.split()[-1]) / 1024


RATE, SECONDS, BOXES = 25, 3600, 1_200_000
WIDTH, HEIGHT = 1280, 720


def seconds_of_count(folder: Path) -> float:
    """Return the processor time of the whole program for the tracks of an hour.

    It is one thread: on a machine without other work, this is how long it takes.
    """
    tracks, lines = folder / "hour.csv", folder / "lines.yaml"
    write_hour(tracks)
    ends = [((100, y), (1180, y + 20)) for y in (300, 350, 400, 470, 560)]
    ends += [((x, 200), (x + 20, 700)) for x in (200, 400, 640, 850, 1080)]
    named = [{"name": f"line {n}", "start": a, "end": b} for n, (a, b) in enumerate(ends)]
    settings = {"camera": {"size": [WIDTH, HEIGHT]}, "traffic": {"lines": named}}
    lines.write_text(json.dumps(settings), encoding="utf-8")
    return seconds_of("-m", "vdet", "--quiet", "count", str(tracks), "-c", str(lines))


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

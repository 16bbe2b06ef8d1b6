"""The program as a separate process, that tests can watch, signal and kill."""

import csv
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from red_cars import car_at, road
from vdet.boxes import Image
from vdet.config.schema import OutputSettings
from vdet.media import Frame, Picture, VideoInfo
from vdet.media.frame import Tags
from vdet.media.reader import VideoReader
from vdet.media.writer import VideoWriter

SOON = 300.0  # seconds; a limit for what takes a moment, on a very busy machine


@dataclass(frozen=True)
class Outcome:
    """What a run of the program left behind."""

    code: int
    out: str
    err: str


HOLDS_VIDEOS = """
import os, time
from pathlib import Path
from vdet.media.reader import VideoReader

folder = Path(__file__).parent
frames = VideoReader.__iter__

def held(reader):
    for frame in frames(reader):
        if frame.index == 40:
            (folder / "held" / str(os.getpid())).touch()
            while not (folder / "open").exists():
                time.sleep(0.02)
        yield frame

VideoReader.__iter__ = held
"""


def write_images(
    path: Path,
    images: Sequence[Image],
    *,
    rate: int = 25,
    created: str | None = None,
    **output: Any,
) -> Path:
    """Write images as a video; `output` are settings of it."""
    height, width = images[0].shape[:2]
    info = VideoInfo(path, width, height, Fraction(rate), Fraction(1, rate), frames=len(images))
    info = replace(info, tags=Tags(creation_time=created))
    with VideoWriter(path, info, OutputSettings.model_validate(output)) as writer:
        for index, image in enumerate(images):
            picture = Picture(np.ascontiguousarray(image))
            writer.write(Frame(index, Fraction(index, rate), picture))
    return path


def write_drive(
    path: Path, frames: int, *, noise: bool = False, created: str | None = None
) -> Path:
    """Write a video of the red car that drives along; with `noise` a frame has some 30 kB."""
    random = np.random.default_rng(1)
    images = [road(car_at(index % 200)) for index in range(frames)]
    if noise:
        images = [image + random.integers(0, 100, image.shape, np.uint8) for image in images]
    return write_images(path, images, created=created, preset="ultrafast")


def frames_of(path: Path | None) -> int:
    """Read a video to its end, and count its frames."""
    assert path is not None
    with VideoReader(path) as reader:
        return sum(1 for _ in reader)


def rows_of(path: Path) -> list[dict[str, str]]:
    """Read a table."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def until(condition: Callable[[], bool], seconds: float = SOON) -> None:
    """Wait for another process or thread."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            pytest.fail("waited for nothing")
        time.sleep(0.02)


def names(folder: Path) -> list[str]:
    """Return the names of all files in a folder and below it."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


@dataclass(frozen=True)
class Gate:
    """Holds videos at frame 40 until it is opened, however slow the machine.

    It works in programs that are started with its `folder` on `PYTHONPATH`.
    """

    folder: Path

    def __post_init__(self) -> None:
        (self.folder / "held").mkdir()
        (self.folder / "sitecustomize.py").write_text(HOLDS_VIDEOS)

    def held(self) -> list[int]:
        """Return the processes in which a video has come to frame 40."""
        return [int(path.name) for path in (self.folder / "held").iterdir()]

    def open(self) -> None:
        """Let all videos go on."""
        (self.folder / "open").touch()


def with_modules(folder: Path) -> dict[str, str]:
    """Return an environment in which `folder` comes first on the path of modules."""
    path = os.environ.get("PYTHONPATH")
    return os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), *([path] if path else [])])}


@dataclass
class Running:
    """A process of the program; it leads its own session."""

    process: "subprocess.Popen[str]"

    def children(self) -> list[int]:
        """Return the processes that it started."""
        return [pid for pid in _session(self.process.pid) if pid != self.process.pid]

    def is_alone(self) -> bool:
        """Return whether none of the processes that it started is left."""
        return not self.children()

    def send(self, number: signal.Signals, *, to_all: bool = False) -> None:
        """Send a signal; `to_all`: to every process of the session, as a terminal does."""
        (os.killpg if to_all else os.kill)(self.process.pid, number)

    def finish(self, seconds: float = SOON) -> Outcome:
        """Wait for its end, and return its exit code and output."""
        out, err = self.process.communicate(timeout=seconds)
        return Outcome(self.process.returncode, out, err)

    def stop(self) -> None:
        """Kill it and all processes that it started."""
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.communicate()


def start(
    arguments: Iterable[str | Path],
    *,
    modules: Path | None = None,
    largest_file: int | None = None,
    before: Callable[[], object] = lambda: None,
) -> Running:
    """Start the program.

    Parameters
    ----------
    modules
        A folder that comes first on the path of modules; a `sitecustomize.py` in it is run before
        the program, and in its worker processes.
    largest_file
        Limit for the size of a file, bytes.
    before
        Called in the new process before the program.
    """

    def prepare() -> None:
        signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job may ignore it
        if largest_file is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))
        before()

    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "vdet", *map(str, arguments)],  # as the installed program
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=with_modules(modules) if modules else None,
        start_new_session=True,
        preexec_fn=prepare,  # noqa: PLW1509
    )
    return Running(process)


def _session(leader: int) -> list[int]:
    pids = [int(entry) for entry in os.listdir("/proc") if entry.isdigit()]  # noqa: PTH208
    return [pid for pid in pids if _is_in(pid, leader)]


def _is_in(pid: int, session: int) -> bool:
    try:
        state, *_ = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return state != "Z" and os.getsid(pid) == session
    except (FileNotFoundError, ProcessLookupError):
        return False

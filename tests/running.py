"""The program as a process of its own, that can be watched, signalled and killed."""

import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from conftest import Outcome
from red_cars import HEIGHT, WIDTH, car_at, road
from vdet.config.schema import OutputSettings
from vdet.media import Frame, VideoInfo, VideoReader, VideoWriter

SOON = 60.0  # seconds; a limit for what comes at once, on a very busy machine


def write_drive(path: Path, frames: int, *, noise: bool = False) -> Path:
    """Write a video of the red car that drives along; with `noise` a frame has some 30 kB."""
    random = np.random.default_rng(1)
    info = VideoInfo(path, WIDTH, HEIGHT, Fraction(25), Fraction(1, 25), frames=frames)
    with VideoWriter(path, info, OutputSettings(preset="ultrafast")) as writer:
        for index in range(frames):
            image = road(car_at(index % 200))
            if noise:
                image += random.integers(0, 100, image.shape, np.uint8)
            writer.write(Frame(index, Fraction(index, 25), image))
    return path


def frames_of(path: Path | None) -> int:
    """Play a video to its end, and count."""
    assert path is not None
    with VideoReader(path) as reader:
        return sum(1 for _ in reader)


def until(condition: Callable[[], bool], seconds: float = SOON) -> None:
    """Wait for another process."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            pytest.fail("it never came to that")
        time.sleep(0.02)


def names(folder: Path) -> list[str]:
    """Give all files in a folder and below it."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def unfinished(folder: Path) -> list[Path]:
    """Give the videos of which a beginning has been written."""
    return [path for path in folder.rglob(".*.vdet-*.mp4") if path.stat().st_size]


@dataclass
class Running:
    """A process of the program, leader of a session of its own."""

    process: "subprocess.Popen[str]"

    def children(self) -> list[int]:
        """Give the processes that work for it."""
        return [pid for pid in _session(self.process.pid) if pid != self.process.pid]

    def is_alone(self) -> bool:
        """Tell whether nothing works for it any more, nor goes on after it."""
        return not self.children()

    def workers(self) -> list[int]:
        """Give the processes that files are given to."""
        marks = b"loky.backend.popen_loky"
        return [pid for pid in self.children() if marks in _command(pid)]

    def send(self, number: signal.Signals, *, to_all: bool = False) -> None:
        """Send a signal; `to_all` as a terminal does, to every process."""
        (os.killpg if to_all else os.kill)(self.process.pid, number)

    def finish(self, seconds: float = SOON) -> Outcome:
        """Wait for its end, and say how that was."""
        out, err = self.process.communicate(timeout=seconds)
        return Outcome(self.process.returncode, out, err)

    def stop(self) -> None:
        """Leave nothing of it behind."""
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.communicate()


def start(
    arguments: Iterable[str | Path],
    *,
    environment: Mapping[str, str] | None = None,
    largest_file: int | None = None,
    before: Callable[[], object] = lambda: None,
) -> Running:
    """Start the program, after the call of `before` in its process.

    No file may become larger than `largest_file` bytes.
    """

    def prepare() -> None:
        signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job ignores it
        if largest_file is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))
        before()

    process = subprocess.Popen(
        [sys.executable, "-m", "vdet", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | dict(environment or {}),
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


def _command(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except (FileNotFoundError, ProcessLookupError):
        return b""

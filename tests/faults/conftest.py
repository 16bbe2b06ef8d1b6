"""Clips that take a while, and the program as a process that nothing is left of."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from running import Running, start, write_drive

Start = Callable[..., Running]


@pytest.fixture
def launch() -> Iterator[Start]:
    """Start the program in the background; what a test leaves of it is ended."""
    started: list[Running] = []

    def launch_it(*arguments: str | Path, **options: object) -> Running:
        started.append(start(arguments, **options))  # type: ignore[arg-type]
        return started[-1]

    yield launch_it
    for running in started:
        running.stop()


HOLDS = """
import os, time
from pathlib import Path
from vdet.media.reader import VideoReader

frames = VideoReader.__iter__

def held(reader):
    for frame in frames(reader):
        while frame.index == 100 and not Path(os.environ["VDET_TEST_GATE"]).exists():
            time.sleep(0.02)
        yield frame

VideoReader.__iter__ = held
"""


@dataclass(frozen=True)
class Gate:
    """Holds every video at its hundredth frame until it is opened, however slow the machine."""

    path: Path

    @property
    def environment(self) -> dict[str, str]:
        """What a program is started with to be held."""
        return {"PYTHONPATH": str(self.path.parent), "VDET_TEST_GATE": str(self.path)}

    def open(self) -> None:
        """Let all videos go on."""
        self.path.touch()


@pytest.fixture
def gate(tmp_path_factory: pytest.TempPathFactory) -> Gate:
    """A gate that is closed."""
    folder = tmp_path_factory.mktemp("gate")
    (folder / "sitecustomize.py").write_text(HOLDS)
    return Gate(folder / "open")


@pytest.fixture(scope="session")
def long_clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clip that takes some seconds."""
    return write_drive(tmp_path_factory.mktemp("long") / "long.mp4", frames=600)


@pytest.fixture(scope="session")
def clips(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of two clips that take a second or two, and a short one."""
    folder = tmp_path_factory.mktemp("clips")
    for name, frames in (("a", 300), ("b", 300), ("short", 5)):
        write_drive(folder / f"{name}.mp4", frames)
    return folder

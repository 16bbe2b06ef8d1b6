"""Clips that take a while, and the program as a process that is ended after the test."""

import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from running import Gate, Running, start, write_drive

Start = Callable[..., Running]


@pytest.fixture(autouse=True)
def default_signals() -> Iterator[None]:
    """Programs inherit which signals are ignored; under nohup it is SIGHUP."""
    numbers = (signal.SIGINT, signal.SIGHUP)
    ignored = [number for number in numbers if signal.getsignal(number) == signal.SIG_IGN]
    for number in ignored:
        signal.signal(number, signal.SIG_DFL)
    yield
    for number in ignored:
        signal.signal(number, signal.SIG_IGN)


@pytest.fixture
def launch() -> Iterator[Start]:
    """Start the program in the background; at the end of the test its processes are killed."""
    started: list[Running] = []

    def launch_it(*arguments: str | Path, **options: object) -> Running:
        started.append(start(arguments, **options))  # type: ignore[arg-type]
        return started[-1]

    yield launch_it
    for running in started:
        running.stop()


@pytest.fixture
def gate(tmp_path_factory: pytest.TempPathFactory) -> Gate:
    """A gate that is closed."""
    return Gate(tmp_path_factory.mktemp("gate"))


@pytest.fixture(scope="session")
def long_clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clip of 100 frames."""
    return write_drive(tmp_path_factory.mktemp("long") / "long.mp4", frames=100)


@pytest.fixture(scope="session")
def clips(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of two clips of 100 frames, and one of five."""
    folder = tmp_path_factory.mktemp("clips")
    for name, frames in (("a", 100), ("b", 100), ("short", 5)):
        write_drive(folder / f"{name}.mp4", frames)
    return folder

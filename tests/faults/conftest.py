"""Clips that take a while, and the program as a process that is ended after the test."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from red_cars import SETTINGS, red_finder
from running import Gate, Running, start, write_drive
from vdet.batch.task import Work
from vdet.detect.svm.model import save_model
from vdet.pipeline.loop import VideoJob
from vdet.pipeline.sinks.protocol import Output

Start = Callable[..., Running]


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


def job_of(source: Path, folder: Path) -> VideoJob:
    """Return a job that writes a video and tracks into a folder."""
    video, tracks = (folder / f"{source.stem}{suffix}" for suffix in (".mp4", ".csv"))
    return VideoJob(source, (Output("video", video), Output("tracks", tracks)))


@pytest.fixture(scope="session")
def work(tmp_path_factory: pytest.TempPathFactory) -> Work:
    """What a file of a batch is processed with: the model that finds red cars."""
    path = tmp_path_factory.mktemp("model") / "red.npz"
    save_model(red_finder(), path)
    return Work(SETTINGS, path, threads=1)


@pytest.fixture(scope="session")
def long_clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clip of 600 frames."""
    return write_drive(tmp_path_factory.mktemp("long") / "long.mp4", frames=600)


@pytest.fixture(scope="session")
def clips(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of two clips of 300 frames, and one of five."""
    folder = tmp_path_factory.mktemp("clips")
    for name, frames in (("a", 300), ("b", 300), ("short", 5)):
        write_drive(folder / f"{name}.mp4", frames)
    return folder

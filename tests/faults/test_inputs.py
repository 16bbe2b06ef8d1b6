"""Inputs that vanish, shrink or stall while they are read."""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from clips import remuxed
from faults.conftest import Start
from labels.writers import Boxed, Labelled, write_yolo
from red_cars import CAR, HEIGHT, SETTINGS, WIDTH, red_model, red_settings
from running import frames_of, names, until, write_drive
from vdet.batch import process_file
from vdet.errors import VdetError
from vdet.labels.reading import read_labelled_images
from vdet.run.loop import Parts
from vdet.run.sinks import Output
from vdet.run.video import Run, run_video
from vdet.workers import Progress

COUNT = 60


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    """A clip too large for a reader to have all of it in memory."""
    (tmp_path / "in").mkdir()
    return write_drive(tmp_path / "in" / "clip.mp4", COUNT, noise=True)


@pytest.fixture
def job(clip: Path, tmp_path: Path) -> Run:
    (tmp_path / "out").mkdir()
    outputs = {"video": "clip.mp4", "tracks": "clip.csv"}
    return Run(clip, tuple(Output(sink, tmp_path / "out" / name) for sink, name in outputs.items()))


def after(frames: int, happens: Callable[[], object]) -> Progress:
    """Return `Progress` that call `happens` when `frames` frames are done."""
    left = iter(range(frames))

    def advance(_: int) -> None:
        if next(left, None) == frames - 1:
            happens()

    return lambda *_: advance


def test_a_file_that_is_removed_while_it_is_read_is_read_to_its_end(job: Run) -> None:
    run_video(
        replace(job, settings=SETTINGS), Parts(red_model()), progress=after(5, job.source.unlink)
    )
    assert frames_of(job.outputs[0].path) == COUNT


def test_a_file_that_is_removed_before_its_turn_is_recorded(job: Run, tmp_path: Path) -> None:
    job.source.unlink()
    record = process_file(replace(job, settings=red_settings(tmp_path)), folder=tmp_path / "out")
    assert record.error == f"{job.source}: not found; check the name"
    assert (record.width, record.height, record.frames, record.tracks) == (None,) * 4
    assert record.outputs == ()


def test_a_file_that_shrinks_is_read_as_far_as_it_goes_with_a_warning(
    job: Run, caplog: pytest.LogCaptureFixture
) -> None:
    half = job.source.stat().st_size // 2
    shrink = after(5, lambda: os.truncate(job.source, half))
    totals = run_video(replace(job, settings=SETTINGS), Parts(red_model()), progress=shrink)
    assert COUNT // 4 < totals.frames < COUNT * 3 // 4
    assert frames_of(job.outputs[0].path) == totals.frames
    assert f"ends early: {totals.frames} of {COUNT} frames could be read" in caplog.text


def test_a_fifo_in_a_set_of_labelled_pictures_is_not_waited_for(tmp_path: Path) -> None:
    boxes = (Boxed("car", (CAR.x1, CAR.y1, CAR.width, CAR.height)),)
    write_yolo(tmp_path, {name: Labelled(WIDTH, HEIGHT, boxes) for name in "ab"})
    (tmp_path / "labels" / "a.txt").unlink()
    os.mkfifo(tmp_path / "labels" / "a.txt")
    found = list(read_labelled_images(tmp_path).images)
    assert [len(picture.labels) for picture in found] == [0, 1]
    (tmp_path / "images" / "a.png").unlink()
    os.mkfifo(tmp_path / "images" / "a.png")
    with pytest.raises(VdetError, match=r"a\.png"):
        list(read_labelled_images(tmp_path).images)


def test_a_fifo_where_a_coco_file_may_be_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "labels.json")
    for path in (tmp_path, tmp_path / "labels.json"):
        with pytest.raises(VdetError, match="labelled images not found"):
            read_labelled_images(path)


class Pipe:
    """A named pipe through which `content` comes, and then neither more data nor an end."""

    def __init__(self, path: Path, content: bytes) -> None:
        self.path = path
        self._content = content
        self._end = threading.Event()
        os.mkfifo(path)
        self._thread = threading.Thread(target=self._feed)
        self._thread.start()

    def _feed(self) -> None:
        with self.path.open("wb", buffering=0) as pipe:
            pipe.write(self._content)
            self._end.wait()

    def close(self) -> None:
        self._end.set()
        os.close(os.open(self.path, os.O_RDWR | os.O_NONBLOCK))  # where no reader has come
        self._thread.join()


@pytest.fixture
def pipe(clip: Path, tmp_path: Path) -> Iterator[Pipe]:
    """A pipe that gives two thirds of the clip, as a transport stream."""
    content = remuxed(tmp_path / "in" / "clip.ts", clip).read_bytes()
    pipe = Pipe(tmp_path / "in" / "pipe.ts", content[: len(content) * 2 // 3])
    yield pipe
    pipe.close()


def test_ctrl_c_ends_the_wait_for_an_input_that_stalls(
    launch: Start, pipe: Pipe, tmp_path: Path
) -> None:
    (tmp_path / "out").mkdir()
    running = launch("detect-video", pipe.path, tmp_path / "out" / "out.mp4")
    until(lambda: bool(names(tmp_path / "out")))
    running.send(signal.SIGINT)
    result = running.finish()
    assert (result.code, result.err.strip()) == (130, "vdet: interrupted")
    assert names(tmp_path / "out") == []


def test_ctrl_c_ends_the_wait_for_an_input_that_does_not_open(
    launch: Start, tmp_path: Path
) -> None:
    os.mkfifo(tmp_path / "pipe.ts")
    running = launch("detect-video", tmp_path / "pipe.ts", tmp_path / "out.mp4")
    with (tmp_path / "pipe.ts").open("wb"):  # returns when the program has opened it too
        running.send(signal.SIGINT)
        result = running.finish()
    assert (result.code, result.err.strip()) == (130, "vdet: interrupted")

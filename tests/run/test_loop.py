"""The loop: what is found in a video, what is kept, and what is left when something breaks."""

import gc
import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from red_cars import PERSPECTIVE, SETTINGS, by_perspective, car_at, drive, red_model, road
from run.red_runs import follow, outputs, run_red
from running import write_drive
from vdet.boxes import Image
from vdet.config.schema import Settings
from vdet.errors import VdetError, VideoError
from vdet.media import Frame
from vdet.media.frame import Planes
from vdet.run import video
from vdet.run.loop import FIRST_FRAMES, Parts
from vdet.run.steps import FrameResult
from vdet.run.video import Run, run_video
from vdet.workers import SearchThreads

QUEUED = 24
"""Largest number of frames that a run may hold at a time."""


class Says:
    """A step that adds a fact."""

    def __init__(self, name: str) -> None:
        self._name = name

    def apply(self, result: FrameResult) -> FrameResult:
        return replace(result, facts={self._name: self})

    def record(self) -> dict[str, list[float]]:
        return {"values": [math.nan, 1.0, -math.inf]}


def test_facts_of_a_step_are_json_and_replace_nothing(red_clip: Path, tmp_path: Path) -> None:
    run = Run(red_clip, outputs(tracks=tmp_path / "t.jsonl"), frames=5)
    run_red(run, steps=[Says("mine")])
    for line in (tmp_path / "t.jsonl").read_text().splitlines():
        assert '"mine": {"values": [null, 1.0, null]}' in line
    with pytest.raises(VdetError, match="tracks: a step must name its fact differently"):
        run_red(replace(run, overwrite=True), steps=[Says("tracks")])


class TestFollowFrames:
    @pytest.mark.parametrize("settings", [SETTINGS, PERSPECTIVE], ids=["original", "default"])
    @pytest.mark.parametrize("threads", [3, 5])
    def test_gives_the_same_with_any_number_of_threads(
        self, settings: Settings, threads: int
    ) -> None:
        one, many = (list(follow(drive(20), settings, threads=number)) for number in (1, threads))
        assert [result.tracks for result in many] == [result.tracks for result in one]
        assert [result.frame.index for result in many] == list(range(20))
        for first, second in zip(one, many, strict=True):
            for name in ("sides", "scores"):
                np.testing.assert_array_equal(
                    getattr(first.detections, name), getattr(second.detections, name)
                )
            heat, same = (item.detections.trace[1].values for item in (first, second))
            np.testing.assert_array_equal(heat, same)


def test_the_horizon_is_looked_for_in_the_first_frames_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[list[Image]] = []

    def find(images: Sequence[Image]) -> float:
        asked.append(list(images))
        return 0.35

    monkeypatch.setattr("vdet.detect.svm.detector.find_horizon", find)
    list(follow(drive(12), by_perspective(None, 0.15, 0.2)))
    (images,) = asked
    assert len(images) == FIRST_FRAMES == 2
    for index, image in enumerate(images):
        np.testing.assert_array_equal(image, road(car_at(index)))


def test_a_whole_run_holds_few_frames_at_a_time(red_clip: Path, tmp_path: Path) -> None:
    def frames_alive() -> int:
        return sum(type(item) is Frame for item in gc.get_objects())

    others = frames_alive()  # of tests before this one
    calls = count()
    held: list[int] = []

    def advance(_: int) -> None:
        if next(calls) % 6 == 5:  # looking takes a while
            held.append(frames_alive() - others)

    wanted = outputs(video=tmp_path / "out.mp4", tracks=tmp_path / "out.csv")
    run_red(video.Run(red_clip, wanted, threads=2), progress=lambda *_: advance)
    assert held
    assert 0 < max(held) <= QUEUED


class TestRun:
    def test_without_a_number_all_cores_that_the_process_may_use_search(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        pools: list[int] = []

        def note(count: int) -> SearchThreads:
            pools.append(count)
            return SearchThreads(count)

        monkeypatch.setattr("vdet.run.video.core_count", lambda: 3)
        monkeypatch.setattr("vdet.run.loop.SearchThreads", note)
        job = video.Run(write_drive(tmp_path / "a.mp4", 2))
        run_video(replace(job, settings=SETTINGS), Parts(red_model()))
        run_video(replace(job, threads=2, settings=SETTINGS), Parts(red_model()))
        assert pools == [3, 2]


def _breaking(method: Callable[..., object], error: BaseException) -> Callable[..., object]:
    """Return a method that works ten times and then breaks."""
    calls = iter(range(10))

    def call(*arguments: object) -> object:
        if next(calls, None) is None:
            raise error
        return method(*arguments)

    return call


def test_when_the_reader_breaks_neither_files_nor_threads_are_left(
    red_clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    threads = threading.active_count()
    wanted = outputs(video=tmp_path / "out.mp4", tracks=tmp_path / "out.csv")
    error = VideoError("its pixels cannot be converted")
    monkeypatch.setattr("vdet.media.reader.Planes", _breaking(Planes, error))
    with pytest.raises(VdetError, match="its pixels"):
        run_red(video.Run(red_clip, wanted))
    assert list(tmp_path.iterdir()) == []
    assert threading.active_count() == threads

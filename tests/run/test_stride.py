"""The detector searches some frames, and every frame has its tracks."""

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from red_cars import HEIGHT, PERSPECTIVE, SETTINGS, WIDTH, drive
from run.red_runs import COUNT, follow, outputs, run_red, write
from vdet.config.schema import MotionTrackerSettings, Settings, SvmSettings
from vdet.media import Picture
from vdet.run.loop import NullDetector, Pipeline
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import Output
from vdet.run.video import VideoJob
from vdet.track.factory import make_tracker


def strided(stride: int, settings: Settings = PERSPECTIVE) -> Settings:
    detector = settings.detector.model_copy(update={"stride": stride})
    return settings.model_copy(update={"detector": detector, "tracker": MotionTrackerSettings()})


def followed(stride: int, count: int = 40, *, skip: int = 0) -> list[FrameResult]:
    frames = list(drive(count))[skip:]
    return list(follow(frames, strided(stride)))


def test_the_first_frame_and_every_nth_after_it_are_searched() -> None:
    assert [result.searched for result in followed(3, 9)] == [True, False, False] * 3
    later = followed(3, 9, skip=2)
    assert [result.searched for result in later] == [True, False, False, True, False, False, True]


def test_frames_that_are_not_searched_have_no_detections_and_predicted_tracks() -> None:
    results = followed(2)
    for result in results:
        if not result.searched:
            assert len(result.detections) == 0
            assert all(track.predicted for track in result.tracks)
    assert any(result.tracks for result in results if not result.searched)


def test_results_do_not_depend_on_the_threads() -> None:
    frames = list(drive(20))
    one, three = (list(follow(frames, strided(3), threads=threads)) for threads in (1, 3))
    assert [each.tracks for each in one] == [each.tracks for each in three]


def test_the_detector_gets_the_number_of_each_frame_that_it_searches() -> None:
    searched: list[int | None] = []

    class Noting(NullDetector):
        def search(self, picture: object, index: int | None) -> None:  # noqa: ARG002
            searched.append(index)

    tracker = make_tracker(SETTINGS, WIDTH, HEIGHT)
    list(Pipeline(Noting(), tracker, stride=4).follow(list(drive(20))[7:]))
    assert searched == [7, 11, 15, 19]


def test_a_tracker_that_cannot_carry_holds_its_vehicles() -> None:
    detector = SETTINGS.detector.model_copy(update={"stride": 2})
    results = list(follow(drive(40), SETTINGS.model_copy(update={"detector": detector})))
    for before, after in zip(results[20::2], results[21::2], strict=True):
        assert [track.box for track in after.tracks] == [track.box for track in before.tracks]
        assert after.tracks
        assert all(track.predicted for track in after.tracks)


def test_the_output_has_every_frame(red_clip: Path, tmp_path: Path) -> None:
    path = tmp_path / "tracks.jsonl"
    run_red(VideoJob(red_clip, outputs(tracks=path)), strided(4))
    records = [json.loads(line) for line in path.read_text().splitlines()]
    assert [record["frame"] for record in records] == list(range(COUNT))
    seen = {record["frame"] for record in records for t in record["tracks"] if not t["predicted"]}
    assert seen
    assert all(number % 4 == 0 for number in seen)


def test_a_stage_sink_waits_for_a_searched_frame(tmp_path: Path) -> None:
    results = followed(3, 6)
    write(Output("stages", tmp_path / "stages"), results[1:3])
    assert not (tmp_path / "stages").exists()
    write(Output("stages", tmp_path / "stages"), results[1:4])
    assert (tmp_path / "stages" / "5-boxes.png").exists()


def test_a_hit_leaves_the_heat_when_as_many_frames_were_searched() -> None:
    settings = strided(2)
    searched = settings.svm.heat.frames
    frames = list(drive(8 * searched))
    empty = Picture(np.full_like(frames[0].image, 90))
    left = [*frames[: 2 * searched], *(replace(f, picture=empty) for f in frames[2 * searched :])]
    results = list(follow(left, settings))
    found = [len(result.detections) for result in results if result.searched]
    assert found[searched - 1] == 1
    assert not any(found[2 * searched - 1 :])


@pytest.mark.parametrize(
    ("rate", "stride"), [(1, 1), (7.9, 1), (15, 1), (24, 3), (25, 3), (30, 3), (50, 6), (60, 7)]
)
def test_at_least_so_many_frames_a_second_are_searched(rate: float, stride: int) -> None:
    settings = SvmSettings(searches=8)
    assert settings.stride_at(Fraction(rate)) == stride
    assert settings.model_copy(update={"stride": 2}).stride_at(Fraction(rate)) == 2


def test_every_frame_is_searched_where_no_number_is_given() -> None:
    assert SvmSettings(searches=None).stride_at(Fraction(25)) == 1


def test_which_frames_are_searched_follows_from_the_rate_of_the_video() -> None:
    detector = PERSPECTIVE.detector.model_copy(update={"searches": 12.0, "stride": None})
    results = follow(drive(5), PERSPECTIVE.model_copy(update={"detector": detector}))
    assert [result.searched for result in results] == [True, False, True, False, True]

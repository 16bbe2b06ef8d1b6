"""The detector searches some frames, and every frame has its tracks."""

from fractions import Fraction
from pathlib import Path

import pytest

from red_cars import PERSPECTIVE, SETTINGS, drive
from run.red_runs import follow, write
from vdet.config.schema import MotionTrackerSettings, Settings, SvmSettings
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import Output


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


def test_a_tracker_that_cannot_carry_holds_its_vehicles() -> None:
    detector = SETTINGS.detector.model_copy(update={"stride": 2})
    results = list(follow(drive(40), SETTINGS.model_copy(update={"detector": detector})))
    for before, after in zip(results[20::2], results[21::2], strict=True):
        assert [track.box for track in after.tracks] == [track.box for track in before.tracks]
        assert after.tracks
        assert all(track.predicted for track in after.tracks)


def test_a_stage_sink_waits_for_a_searched_frame(tmp_path: Path) -> None:
    results = followed(3, 6)
    write(Output("stages", tmp_path / "stages"), results[1:3])
    assert not (tmp_path / "stages").exists()
    write(Output("stages", tmp_path / "stages"), results[1:4])
    assert (tmp_path / "stages" / "5-boxes.png").exists()


@pytest.mark.parametrize(
    ("rate", "stride"), [(1, 1), (7.9, 1), (15, 1), (24, 3), (25, 3), (30, 3), (50, 6), (60, 7)]
)
def test_the_stride_follows_from_the_rate_of_the_video(rate: float, stride: int) -> None:
    settings = SvmSettings(searches=8)
    assert settings.stride_at(Fraction(rate)) == stride
    assert settings.model_copy(update={"stride": 2}).stride_at(Fraction(rate)) == 2

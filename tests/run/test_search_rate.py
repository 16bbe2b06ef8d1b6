"""The detector searches some frames, chosen by their times, and every frame has its tracks."""

from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import accumulate, pairwise
from pathlib import Path

import numpy as np
import pytest

from red_cars import CAR, PERSPECTIVE, drive, road
from run.red_runs import follow, write
from vdet.config.schema import MotionTrackerSettings, NetworkSettings, SvmSettings
from vdet.errors import OutputError
from vdet.media import Frame, Picture
from vdet.run.loop import SearchRate
from vdet.run.result import FrameResult
from vdet.run.sinks import Output

PICTURE = Picture(road(CAR))
OF_NETWORK, OF_SVM = NetworkSettings().searches_per_second, SvmSettings().searches_per_second


def searched(rate: SearchRate, times: Iterable[float | Fraction]) -> list[int]:
    """Return the numbers of the frames that are searched."""
    frames = [Frame(n, Fraction(time), PICTURE) for n, time in enumerate(times)]
    return [frame.index for frame, is_searched in rate.choose(frames) if is_searched]


def steps_to_times(steps: Iterable[float]) -> list[float]:
    return [0.0, *accumulate(steps)]


def longest_wait(rate: SearchRate, times: Sequence[float]) -> float:
    """Return the longest time from one search to the next, seconds."""
    return max(times[b] - times[a] for a, b in pairwise(searched(rate, times)))


class TestSearchesASecond:
    @pytest.mark.parametrize(
        ("searches", "rate", "apart"),
        [
            (OF_NETWORK, 25, 2), (OF_SVM, 25, 3), (OF_NETWORK, 30, 2), (OF_SVM, 30, 3),
            (OF_NETWORK, Fraction(24000, 1001), 2), (OF_NETWORK, Fraction(60000, 1001), 5),
            (OF_NETWORK, 60, 5), (OF_SVM, 50, 6), (OF_SVM, 15, 1), (OF_NETWORK, 5, 1),
        ],
    )  # fmt: skip
    @pytest.mark.parametrize("unit", [None, 1000], ids=["exact", "milliseconds"])
    def test_of_a_steady_rate_every_nth_frame_is_searched(
        self, searches: float, rate: Fraction, apart: int, unit: int | None
    ) -> None:
        times = [Fraction(n) / rate for n in range(300)]
        if unit:  # as Matroska has them
            times = [Fraction(round(time * unit), unit) for time in times]
        assert searched(SearchRate(searches), times) == list(range(0, 300, apart))

    def test_times_that_jitter_do_not_change_that(self) -> None:
        jitter = np.random.default_rng(1).uniform(-0.008, 0.008, 200)
        times = (np.arange(200) * 0.04 + jitter).round(3).tolist()
        chosen = searched(SearchRate(OF_NETWORK), times)
        assert {b - a for a, b in pairwise(chosen[2:])} == {2}, "but for the first two"

    @pytest.mark.parametrize("place", [0, 50])
    def test_a_burst_of_short_steps_is_not_taken_for_the_rate(self, place: int) -> None:
        times = steps_to_times([0.04] * place + [0.001] * 10 + [0.04] * 100)
        assert longest_wait(SearchRate(OF_NETWORK), times) <= 0.09 + 0.04
        last = searched(SearchRate(OF_NETWORK), times)[-20:]
        assert {b - a for a, b in pairwise(last)} == {2}

    def test_a_rate_that_falls_has_every_frame_searched(self) -> None:
        times = steps_to_times([1 / 60] * 120 + [1 / 4] * 20 + [1 / 60] * 120)
        chosen = searched(SearchRate(OF_NETWORK), times)
        assert set(range(120, 141)) <= set(chosen)
        before, after = ([n for n in chosen if a <= n < b] for a, b in ((0, 120), (160, 260)))
        assert {b - a for item in (before, after) for a, b in pairwise(item)} == {5}


def test_frames_are_searched_so_many_times_a_second() -> None:
    detector = PERSPECTIVE.detector.model_copy(update={"stride": None, "searches_per_second": 9})
    settings = PERSPECTIVE.model_copy(update={"detector": detector})
    found = [result.searched for result in follow(drive(30), settings, threads=4)]
    assert found == [n % 2 == 0 for n in range(30)]


@pytest.mark.parametrize("time", [Fraction(1, 25), Fraction(0), float("nan"), float("inf")])
def test_times_that_do_not_increase_are_refused(time: Fraction) -> None:
    frames = [Frame(n, at, PICTURE) for n, at in enumerate((Fraction(0), Fraction(1, 25), time))]
    with pytest.raises(ValueError, match=r"^frame 2 at .*s is not after the last one"):
        list(follow(frames))


def followed(stride: int, count: int = 40, *, skip: int = 0) -> list[FrameResult]:
    detector = PERSPECTIVE.detector.model_copy(update={"stride": stride})
    changes = {"detector": detector, "tracker": MotionTrackerSettings()}
    return list(follow(list(drive(count))[skip:], PERSPECTIVE.model_copy(update=changes)))


def test_the_first_frame_and_every_nth_after_it_are_searched() -> None:
    assert [result.searched for result in followed(3, 9)] == [True, False, False] * 3
    later = followed(3, 9, skip=2)
    assert [result.searched for result in later] == [True, False, False, True, False, False, True]


def test_frames_that_are_not_searched_have_no_detections_and_tracks_between() -> None:
    results = followed(2)
    for result in results:
        if not result.searched:
            assert len(result.detections) == 0
            assert all(track.state == "interpolated" for track in result.tracks)
    assert any(result.tracks for result in results if not result.searched)


def test_a_stage_sink_waits_for_a_searched_frame(tmp_path: Path) -> None:
    results = followed(3, 6)
    with pytest.raises(OutputError, match=r"no frame at 0\.00 s or later; use an earlier --at"):
        write(Output("stages", tmp_path / "stages"), results[1:3])
    assert not (tmp_path / "stages").exists()
    write(Output("stages", tmp_path / "stages"), results[1:4])
    assert (tmp_path / "stages" / "4-boxes.png").exists()

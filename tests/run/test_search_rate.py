"""The detector searches some frames, chosen by their times, and every frame has its tracks."""

from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import accumulate, pairwise
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from boxing import moved_to
from red_cars import CAR, HEIGHT, PERSPECTIVE, WIDTH, drive, road
from run.red_runs import follow, write
from vdet.boxes import Float32Array
from vdet.config.schema import MotionTrackerSettings, NetworkSettings, SvmSettings
from vdet.detect.onnx.detector import NetworkDetector
from vdet.detect.onnx.network import InputForm, Recognized
from vdet.errors import ModelError, OutputError
from vdet.media import Frame, Picture
from vdet.run.loop import Pipeline, SearchRate
from vdet.run.sinks import Output
from vdet.run.steps import FrameResult
from vdet.track.motion.tracker import MotionTracker

IMAGE = Picture(road(CAR))
OF_NETWORK, OF_SVM = NetworkSettings().searches_per_second, SvmSettings().searches_per_second


def searched(rate: SearchRate, times: Iterable[float | Fraction]) -> list[int]:
    """Return the numbers of the frames that are searched."""
    frames = [Frame(n, Fraction(time), IMAGE) for n, time in enumerate(times)]
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


class RedNetwork:
    """Finds what is red, as one car."""

    form, is_named = InputForm(WIDTH, HEIGHT), True

    def find(self, picture: Picture, _: float) -> Float32Array:
        y, x = np.nonzero(picture.image[..., 2] > 2 * picture.image[..., 0].astype(int))
        rows = [(x.min(), y.min(), x.max() + 1, y.max() + 1, 0.9, 0)] if x.size else []
        return np.array(rows, np.float32).reshape(-1, 6)


def searched_by_network(
    lefts: Sequence[int | None], rate: SearchRate, threads: int, fps: Fraction = Fraction(25)
) -> list[int]:
    """Return the frames that are searched if the car is here in each; None: it is not there."""
    network, settings = cast("Recognized", RedNetwork()), NetworkSettings(classes=("car",))
    detector = NetworkDetector(network, network, np.array([0, -1], np.int32), settings)
    tracker = MotionTracker(MotionTrackerSettings(), WIDTH, HEIGHT)
    places = [() if left is None else (moved_to(CAR, left, CAR.y1),) for left in lefts]
    frames = [Frame(n, n / fps, Picture(road(*place))) for n, place in enumerate(places)]
    results = Pipeline(detector, tracker, rate=rate).follow(frames, threads=threads)
    return [result.frame.index for result in results if result.searched]


class TestWhereNothingMoves:
    """A third of the searches is left, but none is missing while anything comes, moves or goes."""

    @pytest.mark.parametrize("threads", [1, 4])
    def test_the_rate_follows_the_traffic(self, threads: int) -> None:
        passing = [*[None] * 50, *range(0, 250, 10), *[None] * 52]
        found = searched_by_network(passing, SearchRate(OF_NETWORK), threads)
        assert found == sorted({*range(0, 127, 6), *range(48, 79, 2)})

    @pytest.mark.parametrize(
        ("left", "fps", "apart"),
        [
            (40, Fraction(25), 6), (None, Fraction(25), 6), (None, Fraction(24), 6),
            (None, Fraction(24_000, 1001), 6), (None, Fraction(60_000, 1001), 15),
        ],
    )  # fmt: skip
    def test_a_car_that_stands_costs_as_little_as_an_empty_road_at_any_rate(
        self, left: int | None, fps: Fraction, apart: int
    ) -> None:
        found = searched_by_network([left] * 91, SearchRate(OF_NETWORK), 2, fps)
        assert found == list(range(0, 91, apart))

    @pytest.mark.parametrize("at", [0, 6])
    @pytest.mark.parametrize("threads", [1, 4])
    def test_an_error_ends_threads_that_wait_for_its_frame(
        self, at: int, threads: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        find = RedNetwork.find

        def fail_on_cars(network: RedNetwork, picture: Picture, minimum: float) -> Float32Array:
            found = find(network, picture, minimum)
            if len(found):
                raise ModelError("shows a car")
            return found

        monkeypatch.setattr(RedNetwork, "find", fail_on_cars)
        with pytest.raises(ModelError, match="shows a car"):
            searched_by_network([*[None] * at, 40, *[None] * 50], SearchRate(OF_NETWORK), threads)

    @pytest.mark.parametrize("rate", [SearchRate(OF_NETWORK, stride=2), SearchRate()])
    def test_a_rate_that_the_user_sets_is_kept(self, rate: SearchRate) -> None:
        assert searched_by_network([None] * 20, rate, 2) == list(range(0, 20, rate.stride or 1))


@pytest.mark.parametrize("time", [Fraction(1, 25), Fraction(0), float("nan"), float("inf")])
def test_times_that_do_not_increase_are_refused(time: Fraction) -> None:
    frames = [Frame(n, at, IMAGE) for n, at in enumerate((Fraction(0), Fraction(1, 25), time))]
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
    with pytest.raises(OutputError, match=r"no frame at 0\.00 s or later; use an earlier time"):
        write(Output("stages", tmp_path / "stages"), results[1:3])
    assert not (tmp_path / "stages").exists()
    write(Output("stages", tmp_path / "stages"), results[1:4])
    assert (tmp_path / "stages" / "6-boxes.png").exists()

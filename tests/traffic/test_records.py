"""A record of each vehicle."""

import pytest

from traffic.passing import RATE, WIDTH, frame, summarize, track
from vdet.boxes import Box
from vdet.track.track import FrameTracks
from vdet.traffic.records import PATH_STEP, VehicleRecord, VehicleRecords

PLACE = Box.sized(100, 100, 40, 30)


def records(*frames: FrameTracks) -> list[VehicleRecord]:
    return list(summarize(frames, WIDTH))


def record(*frames: FrameTracks) -> VehicleRecord:
    (only,) = records(*frames)
    return only


def test_scores_are_those_of_all_frames_and_the_largest_box_is_kept() -> None:
    boxes = [PLACE, Box.sized(90, 90, 60, 50), Box.sized(95, 95, 50, 40)]
    tracks = [track(1, box, score=0.5 + 0.2 * n) for n, box in enumerate(boxes)]
    found = record(*(frame(n, track) for n, track in enumerate(tracks)))
    assert found.mean_score == pytest.approx(0.7)
    assert found.best_score == pytest.approx(0.9)
    assert found.largest == boxes[1]


def test_what_one_frame_shows_has_no_record() -> None:
    assert records(frame(0), frame(1, track(1, PLACE)), frame(2)) == []


@pytest.mark.parametrize(
    ("count", "score", "is_sure"),
    [(12, 0.59, None), (13, 0.59, False), (12, 0.6, False), (13, 0.6, True)],
)
def test_before_a_moving_camera_what_is_neither_long_nor_certain_has_no_record(
    count: int, score: float, is_sure: bool | None
) -> None:
    frames = [frame(n, track(1, PLACE, score=score)) for n in range(count)]
    of_moving, of_fixed = (
        summarize(frames, WIDTH, is_still=is_still) for is_still in (False, True)
    )
    assert [item.is_sure for item in of_moving] == ([] if is_sure is None else [is_sure])
    assert [item.is_sure for item in of_fixed] == [bool(is_sure)]


def test_the_smallest_distance_and_the_usual_lane_are_kept() -> None:
    places = [(30.0, -1), (0.0, 0), (25.0, 0), (None, None)]
    frames = (
        frame(n, track(1, PLACE, distance=metres, lane=lane))
        for n, (metres, lane) in enumerate(places)
    )
    found = record(*frames)
    assert (found.distance, found.lane) == (0.0, 0)
    unknown = record(frame(0, track(1, PLACE)))
    assert (unknown.distance, unknown.lane) == (None, None)


def test_a_vehicle_that_is_hidden_for_a_while_is_shown_for_less_than_its_span() -> None:
    found = record(frame(0, track(1, PLACE)), *map(frame, range(1, 10)), *(
        frame(n, track(1, PLACE)) for n in (10, 11)
    ))  # fmt: skip
    assert (found.first, found.last) == (0, 11 / RATE)
    assert found.seconds == pytest.approx(3 / RATE)


class TestPath:
    def test_a_vehicle_that_stands_and_trembles_goes_nowhere(self) -> None:
        frames = [
            frame(n, track(1, Box.sized(100 + n % 3, 100 - n % 2, 40, 30))) for n in range(500)
        ]
        assert record(*frames).length <= PATH_STEP * WIDTH

    def test_frames_in_which_it_is_lost_add_nothing(self) -> None:
        frames = [
            frame(0, track(1, Box.sized(0, 0, 40, 30), state="predicted")),
            *(frame(n, track(1, Box.sized(100 + 10 * n, 100, 40, 30))) for n in (1, 2, 3)),
            frame(4, track(1, Box.sized(280, 200, 40, 30), state="predicted")),
        ]
        found = record(*frames)
        assert (found.path[0], found.path[-1]) == ((130, 130), (150, 130))
        assert found.states == {"detected": 3, "predicted": 2}


@pytest.mark.parametrize(
    ("is_still", "motions"),
    [(True, {1: "drove", 2: "standing", 3: "unknown"}), (False, dict.fromkeys((1, 2, 3)))],
)
def test_what_stands_before_a_fixed_camera_is_told_apart_from_what_drives(
    is_still: bool, motions: dict[int, str | None]
) -> None:
    made = VehicleRecords(WIDTH)
    for second in range(70):
        tracks = [track(1, Box.sized(3 * second, 100, 40, 30)), track(2, PLACE)]
        if second < 30:
            tracks.append(track(3, Box.sized(200, 180, 50, 40)))
        made.add(frame(second, *tracks, rate=1))
    assert {item.id: item.motion for item in made.end(is_still=is_still)} == motions

import pytest

from evaluate.scenes import drive, video
from labels.saving import row
from vdet.evaluate.comparison import compare
from vdet.evaluate.matching import match
from vdet.evaluate.scores import score
from vdet.evaluate.timelines import FirstDetection, Stretch, Timeline, timelines
from vdet.labels.video import LabelledVideo


def found_timelines(found: LabelledVideo, truth: LabelledVideo) -> list[Timeline]:
    comparison = compare(found, truth)
    return timelines(comparison, match(comparison))


def test_a_vehicle_is_missed_and_then_found() -> None:
    (timeline,) = found_timelines(video(drive(4, range(3, 11))), video(drive(7, range(1, 11))))
    assert timeline == Timeline(7, (Stretch(1, 2, None), Stretch(3, 10, 4)), ())


def test_another_track_after_any_gap_is_a_switch() -> None:
    found = video(drive(4, range(1, 4)), drive(9, range(6, 11)))
    (timeline,) = found_timelines(found, video(drive(7, range(1, 11))))
    assert timeline.stretches == (Stretch(1, 3, 4), Stretch(4, 5, None), Stretch(6, 10, 9))
    assert timeline.switches == (6,)


def test_frames_without_the_vehicle_are_in_no_stretch() -> None:
    truth = video(drive(7, range(1, 4)), drive(7, range(8, 11)), drive(8, range(1, 11), x=300))
    first, second = found_timelines(video(drive(4, range(1, 11))), truth)
    assert first.stretches == (Stretch(1, 3, 4), Stretch(8, 10, 4))
    assert second.stretches == (Stretch(1, 10, None),)


def test_the_delay_is_from_the_first_true_frame_to_the_first_match() -> None:
    truth = video(drive(8, range(5, 20)), drive(9, range(7, 20), x=300))
    found = video(drive(1, range(12, 20)), drive(2, range(7, 20), x=300))
    scores = score(found, truth)
    assert scores.first_detections == (FirstDetection(8, 5, 12), FirstDetection(9, 7, 7))
    assert [each.delay for each in scores.first_detections] == [7, 0]
    assert scores.mean_delay == 3.5


def test_a_vehicle_never_found_has_no_delay() -> None:
    scores = score(video(drive(1, range(1, 5), x=300)), video(drive(8, range(1, 5))))
    assert scores.first_detections == (FirstDetection(8, 1, None),)
    assert scores.first_detections[0].delay is None
    assert scores.never_found == 1


def test_frames_in_which_the_vehicle_is_ignored_are_no_delay() -> None:
    small = [row(0, frame, 8, 0, 0, 100, 100, ignored=True) for frame in range(1, 5)]
    truth = video(small + drive(8, range(5, 10)))
    (first,) = score(video(drive(1, range(6, 10))), truth).first_detections
    assert (first.appears, first.found) == (5, 6)


@pytest.mark.parametrize(("on_vehicle", "false"), [(4, 1), (5, 0), (6, 0)])
def test_a_track_is_false_when_more_than_half_of_it_matches_nothing(
    on_vehicle: int, false: int
) -> None:
    track = drive(1, range(1, 1 + on_vehicle)) + drive(1, range(1 + on_vehicle, 11), x=300)
    assert score(video(track), video(drive(8, range(1, 11)))).false_tracks == false


def test_false_tracks_per_minute_use_the_length_of_the_video() -> None:
    # 2 false tracks in 750 frames at 25 a second, half a minute
    found = video(drive(1, range(1, 9), x=300), drive(2, range(20, 30), x=300))
    truth = video(drive(8, range(741, 751)))
    assert score(found, truth, rate=25).false_tracks_per_minute == pytest.approx(4)

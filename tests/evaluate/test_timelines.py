import pytest

from evaluate.scenes import TEN, drive, video
from labels.saving import row
from vdet.evaluate.comparison import compare
from vdet.evaluate.scores import score
from vdet.evaluate.timelines import (
    FirstDetection,
    Stretch,
    frames_too_long,
    mistakes,
    stretches,
)
from vdet.labels.video import LabelledVideo

TRUE = (8, 5, 0.0), (9, 7, 300.0), (10, 5, 600.0)  # id, first frame, place


def found_mistakes(found: LabelledVideo, truth: LabelledVideo) -> tuple[Stretch, ...]:
    return mistakes(stretches(compare(found, truth)))


def test_each_track_has_its_own_stretch() -> None:
    found = video(drive(4, range(1, 4)), drive(9, range(6, 11)))
    seen = stretches(compare(found, video(drive(7, range(1, 11)))))
    assert [(each.kind, each.first, each.last, each.partner) for each in seen] == [
        ("found", 1, 3, 4),
        ("missed", 4, 5, None),
        ("found", 6, 10, 9),
    ]


def test_the_delay_is_from_the_first_true_frame_to_the_first_match() -> None:
    truth = video(*(drive(id_, range(start, 20), x) for id_, start, x in TRUE))
    found = video(drive(1, range(12, 20)), drive(2, range(7, 20), x=300), drive(3, TEN, x=900))
    scores = score(found, truth)
    first = FirstDetection(8, 5, 12), FirstDetection(9, 7, 7), FirstDetection(10, 5, None)
    assert scores.first_detections == first
    assert [each.delay for each in first] == [7, 0, None]
    assert (scores.mean_delay, scores.never_found) == (3.5, 1)


def test_a_track_that_goes_on_after_its_vehicle_is_shown_too_long() -> None:
    truth = video(drive(8, range(1, 11)), drive(9, range(13, 20)))
    found = video(drive(1, range(1, 16)))  # the second vehicle gets the track of the first
    scores = score(found, truth)
    assert frames_too_long(compare(found, truth)) == (2, 0)
    assert scores.mean_excess == 1.0


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


def test_frames_in_a_row_are_one_mistake_and_the_longest_comes_first() -> None:
    found = video(drive(1, range(3, 6)), drive(1, range(7, 11)))
    late, gap = found_mistakes(found, video(drive(7, TEN)))
    assert late == Stretch("missed", 7, 1, 2, None, 0)
    assert gap == Stretch("missed", 7, 6, 6, None, 0)
    assert (late.boxes, late.middle, gap.boxes, gap.middle) == (2, 1, 1, 6)


def test_a_box_that_fits_badly_is_lost_on_both_sides_with_its_overlap() -> None:
    # 100 wide against 250 wide over it: IoU 0.4
    alarm, missed = found_mistakes(video(drive(1, TEN, width=250)), video(drive(7, TEN)))
    assert (alarm.kind, missed.kind) == ("false alarm", "missed")
    assert alarm.overlap == missed.overlap == pytest.approx(0.4)


def test_frames_in_which_the_vehicle_is_ignored_split_a_mistake() -> None:
    ignored = [row(0, 5, 7, 0, 0, 100, 100, ignored=True)]
    truth = video(drive(7, range(1, 5)) + ignored + drive(7, range(6, 11)))
    spans = [(mistake.first, mistake.last) for mistake in found_mistakes(video(), truth)]
    assert spans == [(6, 10), (1, 4)]

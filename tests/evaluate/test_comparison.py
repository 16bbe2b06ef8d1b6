import pytest

from evaluate.scenes import TEN, drive, video
from labels.saving import row
from vdet.evaluate.comparison import compare, pool
from vdet.evaluate.scores import score_comparison
from vdet.labels.label import NO_ID, Label
from vdet.labels.video import LabelledVideo


def box(id_: int, x: float, width: float = 100, frame: int = 1) -> Label:
    return row(0, frame, id_, x, 0, width, 100)


def region(x: float, width: float, id_: int = NO_ID) -> Label:
    return row(0, 1, id_, x, 0, width, 100, ignored=True)


def kept_tracks(prediction: LabelledVideo, truth: LabelledVideo) -> list[int]:
    comparison = compare(prediction, truth)
    return [int(comparison.track_ids[track]) for f in comparison.frames for track in f.tracks]


def test_a_prediction_in_an_ignore_region_is_dropped() -> None:
    assert kept_tracks(video([box(5, 300)]), video([region(250, 500)])) == []


def test_less_than_half_of_the_own_area_is_not_enough() -> None:
    assert kept_tracks(video([box(5, 149)]), video([region(200, 500)])) == [5]


def test_parts_in_two_regions_are_not_added_up() -> None:
    regions = video([region(0, 140), region(160, 140)])
    assert kept_tracks(video([box(5, 100)]), regions) == [5]


def test_a_prediction_that_finds_a_vehicle_in_a_region_is_kept() -> None:
    assert kept_tracks(video([box(5, 300)]), video([box(1, 310), region(250, 500)])) == [5]


def test_of_two_predictions_on_a_vehicle_in_a_region_the_worse_one_is_dropped() -> None:
    found = video([box(5, 320), box(6, 300)])
    assert kept_tracks(found, video([box(1, 300), region(250, 500)])) == [6]


def test_an_ignored_prediction_counts_only_if_it_finds_a_vehicle() -> None:
    found = [box(id_, x)._replace(ignored=True) for id_, x in ((5, 0), (6, 300))]
    assert kept_tracks(video(found), video([box(1, 10)])) == [5]


def test_frames_with_nothing_that_counts_are_left_out() -> None:
    comparison = compare(video([box(5, 300), box(6, 0, frame=4)]), video([region(250, 500)]))
    assert [frame.number for frame in comparison.frames] == [4]


@pytest.mark.parametrize(
    ("own", "given", "seconds"), [(25, None, 4), (25, 50, 2), (None, 50, 2), (None, None, None)]
)
def test_the_length_comes_from_the_last_frame_and_the_rate(
    own: float | None, given: float | None, seconds: float | None
) -> None:
    found = video([box(5, 0, frame=100)], rate=own)
    assert compare(found, video([box(1, 0)]), rate=given).seconds == seconds


GOOD = compare(video(drive(1, TEN)), video(drive(1, TEN)), rate=25)
POOR = compare(video(drive(1, range(6, 11))), video(drive(1, TEN)), rate=25)


def test_the_same_id_in_two_videos_is_two_vehicles() -> None:
    total = score_comparison(pool([GOOD, POOR]))
    assert (total.vehicles, total.tracks, total.id_switches) == (2, 2, 0)
    assert total.idf1 == pytest.approx(2 * 15 / (20 + 15))  # either track is right throughout
    assert [each.delay for each in total.first_detections] == [0, 5]


def test_the_pooled_length_is_the_sum_if_every_length_is_known() -> None:
    unknown = compare(video(), video(drive(1, TEN)))
    assert pool([GOOD, POOR]).seconds == pytest.approx(0.8)
    assert pool([GOOD, unknown]).seconds is None

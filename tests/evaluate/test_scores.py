"""Cases small enough to be worked out by hand; each says how."""

from dataclasses import asdict

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluate.scenes import TEN, drive, video
from vdet.evaluate.scores import score
from vdet.labels.label import SavedTracks


def test_a_loose_box_lowers_the_overlap_of_the_matches_only() -> None:
    scores = score(video(drive(1, TEN, width=80)), video(drive(1, TEN)))
    assert scores.mean_iou == pytest.approx(0.8)
    assert (scores.f1, scores.mota, scores.idf1) == (1, 1, 1)


def test_two_empty_videos_have_scores_too() -> None:
    scores = score(video(), video())
    assert (scores.vehicles, scores.tracks, scores.f1, scores.hota) == (0, 0, 0, 0)


def test_the_delay_is_from_the_first_true_frame_to_the_first_match() -> None:
    places = (8, 5, 0.0), (9, 7, 300.0), (10, 5, 600.0)  # id, first frame, place
    truth = video(*(drive(id_, range(start, 20), x) for id_, start, x in places))
    found = video(drive(1, range(12, 20)), drive(2, range(7, 20), x=300), drive(3, TEN, x=900))
    scores = score(found, truth)
    assert (scores.delays, scores.mean_delay) == ((7, 0, None), 3.5)


@pytest.mark.parametrize(("on_vehicle", "false"), [(4, 1), (5, 0), (6, 0)])
def test_a_track_is_false_when_more_than_half_of_it_matches_nothing(
    on_vehicle: int, false: int
) -> None:
    track = drive(1, range(1, 1 + on_vehicle)) + drive(1, range(1 + on_vehicle, 11), x=300)
    assert score(video(track), video(drive(8, range(1, 11)))).false_tracks == false


PLACES = st.integers(0, 12).map(lambda step: step * 20.0)
SCENES = st.dictionaries(st.tuples(st.integers(1, 6), st.integers(1, 4)), PLACES, max_size=20).map(
    lambda boxes: video(*(drive(i, range(f, f + 1), x) for (f, i), x in boxes.items()))
)


@given(SCENES, SCENES)
def test_ratios_are_within_their_bounds(found: SavedTracks, truth: SavedTracks) -> None:
    scores = asdict(score(found, truth))
    ratios = ("precision", "recall", "f1", "ap50", "ap50_95", "idf1", "hota", "deta", "assa")
    assert all(0 <= scores[name] <= 1 + 1e-9 for name in ratios)
    assert scores["mota"] <= 1
    assert scores["matches"] + scores["misses"] == scores["vehicle_boxes"]
    assert scores["matches"] + scores["false_positives"] == scores["track_boxes"]

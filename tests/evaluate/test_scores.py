"""Cases small enough to be worked out by hand; each says how."""

from dataclasses import asdict

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluate.scenes import TEN, drive, video
from vdet.evaluate.scores import score
from vdet.labels.video import LabelledVideo


def test_a_loose_box_lowers_the_overlap_of_the_matches_only() -> None:
    scores = score(video(drive(1, TEN, width=80)), video(drive(1, TEN)))
    assert (scores.mean_iou, scores.motp) == pytest.approx((0.8, 0.8))
    assert (scores.f1, scores.mota, scores.idf1) == (1, 1, 1)


def test_two_empty_videos_have_scores_too() -> None:
    scores = score(video(), video())
    assert (scores.vehicles, scores.tracks, scores.f1, scores.hota) == (0, 0, 0, 0)


PLACES = st.integers(0, 12).map(lambda step: step * 20.0)
SCENES = st.dictionaries(st.tuples(st.integers(1, 6), st.integers(1, 4)), PLACES, max_size=20).map(
    lambda boxes: video(*(drive(i, range(f, f + 1), x) for (f, i), x in boxes.items()))
)


@given(SCENES, SCENES)
def test_ratios_are_within_their_bounds(found: LabelledVideo, truth: LabelledVideo) -> None:
    scores = asdict(score(found, truth))
    ratios = ("precision", "recall", "f1", "ap50", "ap50_95", "idf1", "hota", "deta", "assa")
    assert all(0 <= scores[name] <= 1 + 1e-9 for name in ratios)
    assert scores["mota"] <= 1
    assert scores["matches"] + scores["misses"] == scores["vehicle_boxes"]
    assert scores["matches"] + scores["false_positives"] == scores["track_boxes"]
    kinds = ("mostly_tracked", "partly_tracked", "mostly_lost")
    assert sum(scores[name] for name in kinds) == scores["vehicles"]

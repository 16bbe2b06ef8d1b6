import math

import pytest

from labels.saving import row
from vdet.boxes import Box
from vdet.labels.video import SavedTracks


def test_frames_are_those_with_a_box_and_those_that_are_listed() -> None:
    saved = SavedTracks((row(1, 6, 2, 0, 0, 9, 9), row(2, 6, 1, 0, 0, 9, 9)), known=(4, 5, 7))
    frames = tuple(saved)
    assert [frame.index for frame in frames] == [4, 5, 7]
    assert [[track.id for track in frame.tracks] for frame in frames] == [[], [1, 2], []]


def test_boxes_are_rounded_side_by_side_and_scores_are_cut() -> None:
    saved = SavedTracks((row(1, 1, 1, 10.4, 20.6, 30.4, 0.2, score=7.0),))
    (track,) = next(iter(saved)).tracks
    assert track.box == Box(10, 21, 41, 22)
    assert track.score == 1


def test_words_for_a_class_become_ours_and_others_stay() -> None:
    labels = ("Van", "lorry", "tractor", None)
    rows = [row(1, 1, number, 0, 0, 9, 9, name=label) for number, label in enumerate(labels)]
    names = [track.class_name for track in next(iter(SavedTracks(tuple(rows)))).tracks]
    assert names == ["car", "truck", "tractor", None]


def test_a_rate_gives_times_to_frames_without() -> None:
    saved = SavedTracks((row(1, 6, 1, 0, 0, 9, 9), row(1, 7, 1, 0, 0, 9, 9)), times={6: 0.5})
    assert not saved.has_times
    assert math.isnan(next(iter(saved)).time)
    timed = saved.at_rate(10)
    assert timed.has_times
    assert [frame.time for frame in timed] == [0.5, 0.5]


def test_times_tell_the_rate() -> None:
    assert SavedTracks((), times={5: 1.0, 0: 0.5, 10: 0.9}).rate == pytest.approx(25)
    assert SavedTracks((), times={5: 1.0}).rate is None
    assert SavedTracks(()).rate is None

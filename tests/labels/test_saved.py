import math

from labels.saving import row
from vdet.labels.label import SavedTracks


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

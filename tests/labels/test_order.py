"""The order of the frames of saved tracks."""

from vdet.labels.label import SavedTracks


def test_frames_ascend_where_a_set_of_their_numbers_does_not() -> None:
    assert [frame.index for frame in SavedTracks((), (7, 8))] == [7, 8]

from pathlib import Path

from vdet.evaluate.clips.timeline import Stretch, Timeline, timelines
from vdet.evaluate.labelled_video import LabelledVideo
from vdet.evaluate.matching import match
from vdet.evaluate.preprocessing import compare
from vdet.evaluate.rows import Row, collect


def drive(id_: int, frames: range, x: float = 0) -> list[Row]:
    """Return a box of 100 × 100 pixels that stands at `x` in these frames."""
    return [Row(0, frame, id_, x, 0, 100, 100) for frame in frames]


def video(*tracks: list[Row]) -> LabelledVideo:
    return collect(Path("scene"), [row for track in tracks for row in track])


def found_timelines(found: LabelledVideo, truth: LabelledVideo) -> list[Timeline]:
    comparison = compare(found, truth)
    return timelines(comparison, match(comparison))


def test_a_vehicle_is_missed_then_seen() -> None:
    (timeline,) = found_timelines(video(drive(4, range(3, 11))), video(drive(7, range(1, 11))))
    assert timeline == Timeline(7, (Stretch(1, 2, None), Stretch(3, 10, 4)), ())


def test_another_track_that_takes_over_is_a_switch_however_long_the_gap() -> None:
    found = video(drive(4, range(1, 4)), drive(9, range(6, 11)))
    (timeline,) = found_timelines(found, video(drive(7, range(1, 11))))
    assert timeline.stretches == (Stretch(1, 3, 4), Stretch(4, 5, None), Stretch(6, 10, 9))
    assert timeline.switches == (6,)


def test_the_same_track_after_a_gap_is_none() -> None:
    found = video(drive(4, range(1, 4)), drive(4, range(6, 11)))
    (timeline,) = found_timelines(found, video(drive(7, range(1, 11))))
    assert timeline.switches == ()


def test_frames_in_which_the_vehicle_is_away_are_in_no_stretch() -> None:
    truth = video(drive(7, range(1, 4)), drive(7, range(8, 11)), drive(8, range(1, 11), x=300))
    first, second = found_timelines(video(drive(4, range(1, 11))), truth)
    assert first.stretches == (Stretch(1, 3, 4), Stretch(8, 10, 4))
    assert second.stretches == (Stretch(1, 10, None),)

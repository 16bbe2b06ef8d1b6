import pytest

from evaluate.scenes import TEN, drive, video
from labels.saving import row
from vdet.evaluate.comparison import compare
from vdet.evaluate.report import Mistake, mistakes
from vdet.labels.label import LabelledVideo

BOX = 0.0, 0.0, 100.0, 100.0


def found_mistakes(found: LabelledVideo, truth: LabelledVideo) -> tuple[Mistake, ...]:
    return mistakes(compare(found, truth))


def test_frames_in_a_row_are_one_mistake_and_the_longest_comes_first() -> None:
    found = video(drive(1, range(3, 6)), drive(1, range(7, 11)), drive(2, range(2, 5), x=300))
    alarm, late, gap = found_mistakes(found, video(drive(7, TEN)))
    assert alarm == Mistake("false alarm, track", 2, 2, 3, 4, 3, (300.0, 0.0, 400.0, 100.0), 0)
    assert late == Mistake("missed vehicle", 7, 1, 1, 2, 2, BOX, 0)
    assert gap == Mistake("missed vehicle", 7, 6, 6, 6, 1, BOX, 0)
    assert [item.name for item in (alarm, late)] == ["false alarm, track 2", "missed vehicle 7"]
    assert [item.span for item in (late, gap)] == ["1–2", "6"]


def test_a_box_that_fits_badly_is_lost_on_both_sides_with_its_overlap() -> None:
    # 100 wide against 250 wide over it: IoU 0.4
    alarm, missed = found_mistakes(video(drive(1, TEN, width=250)), video(drive(7, TEN)))
    assert (alarm.what, missed.what) == ("false alarm, track", "missed vehicle")
    assert alarm.overlap == missed.overlap == pytest.approx(0.4)


def test_frames_in_which_the_vehicle_is_ignored_split_a_mistake() -> None:
    ignored = [row(0, 5, 7, 0, 0, 100, 100, ignored=True)]
    truth = video(drive(7, range(1, 5)) + ignored + drive(7, range(6, 11)))
    spans = [(mistake.first, mistake.last) for mistake in found_mistakes(video(), truth)]
    assert spans == [(6, 10), (1, 4)]

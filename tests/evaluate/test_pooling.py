from dataclasses import asdict
from pathlib import Path

import pytest

from vdet.evaluate.labelled_video import LabelledVideo
from vdet.evaluate.pooling import pool
from vdet.evaluate.preprocessing import compare
from vdet.evaluate.rows import Row, collect
from vdet.evaluate.scores import score, score_comparison


def drive(id_: int, frames: range, x: float = 0, width: float = 100) -> list[Row]:
    """Return a box of 100 pixels height that stands at `x` in these frames."""
    return [Row(0, frame, id_, x, 0, width, 100) for frame in frames]


def video(*tracks: list[Row]) -> LabelledVideo:
    return collect(Path("scene"), [row for track in tracks for row in track])


TEN = range(1, 11)
GOOD = compare(video(drive(1, TEN)), video(drive(1, TEN)), rate=25)
POOR = compare(video(drive(1, range(6, 11))), video(drive(1, TEN)), rate=25)


def test_the_pool_of_one_video_scores_as_the_video() -> None:
    found, truth = video(drive(1, range(3, 11), x=10)), video(drive(1, TEN))
    assert asdict(score_comparison(pool([compare(found, truth)]))) == asdict(score(found, truth))


def test_the_same_id_in_two_videos_is_two_vehicles() -> None:
    total = score_comparison(pool([GOOD, POOR]))
    assert (total.vehicles, total.tracks, total.id_switches) == (2, 2, 0)
    assert total.idf1 == pytest.approx(2 * 15 / (20 + 15))  # either track is right throughout
    assert [each.delay for each in total.first_detections] == [0, 5]


def test_ratios_are_of_all_boxes_together() -> None:
    assert score_comparison(pool([GOOD, POOR])).recall == pytest.approx(15 / 20)


def test_the_length_is_the_sum_where_every_one_is_known() -> None:
    unknown = compare(video(), video(drive(1, TEN)))
    assert pool([GOOD, POOR]).seconds == pytest.approx(0.8)
    assert pool([GOOD, unknown]).seconds is None

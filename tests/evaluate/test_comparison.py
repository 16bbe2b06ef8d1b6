import pytest

from evaluate.scenes import TEN, drive, video
from labels.saving import Row, row
from vdet.evaluate.scores import compare, pool, score_comparison
from vdet.labels.label import NO_ID


def box(id_: int, x: float, width: float = 100, frame: int = 1) -> Row:
    return row(0, frame, id_, x, 0, width, 100)


def region(x: float, width: float, id_: int = NO_ID) -> Row:
    return row(0, 1, id_, x, 0, width, 100, ignored=True)


IGNORED = [region(x, 100, id_) for id_, x in ((5, 0), (6, 300))]


@pytest.mark.parametrize(
    ("found", "truth", "kept"),
    [
        pytest.param([box(5, 300)], [region(250, 500)], [], id="in a region"),
        pytest.param([box(5, 149)], [region(200, 500)], [5], id="less than half in a region"),
        pytest.param([box(5, 100)], [region(0, 140), region(160, 140)], [5], id="in parts of two"),
        pytest.param([box(5, 300)], [box(1, 310), region(250, 500)], [5], id="finds a vehicle"),
        pytest.param(
            [box(5, 320), box(6, 300)], [box(1, 300), region(250, 500)], [6], id="the worse of two"
        ),
        pytest.param(IGNORED, [box(1, 10)], [5], id="itself ignored"),
    ],
)
def test_predictions_that_count_beside_ignore_regions(
    found: list[Row], truth: list[Row], kept: list[int]
) -> None:
    comparison = compare(video(found), video(truth))
    assert [int(comparison.track_ids[t]) for f in comparison.frames for t in f.tracks] == kept


def test_frames_with_nothing_that_counts_are_left_out() -> None:
    comparison = compare(video([box(5, 300), box(6, 0, frame=4)]), video([region(250, 500)]))
    assert [frame.number for frame in comparison.frames] == [4]


GOOD = compare(video(drive(1, TEN)), video(drive(1, TEN)))
POOR = compare(video(drive(1, range(5, 10))), video(drive(1, TEN)))


def test_the_same_id_in_two_videos_is_two_vehicles() -> None:
    total = score_comparison(pool([GOOD, POOR]))
    assert (total.vehicles, total.tracks, total.id_switches) == (2, 2, 0)
    assert total.idf1 == pytest.approx(2 * 15 / (20 + 15))  # either track is right throughout
    assert total.delays == (0, 5)

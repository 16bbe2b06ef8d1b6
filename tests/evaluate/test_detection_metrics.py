import pytest

from evaluate.scenes import video
from labels.saving import row
from vdet.evaluate.comparison import compare
from vdet.evaluate.detection_metrics import average_precisions
from vdet.labels.label import Label
from vdet.labels.video import LabelledVideo


def box(id_: int, x: float, score: float = 1, width: float = 100, frame: int = 1) -> Label:
    return row(0, frame, id_, x, 0, width, 100, score)


def ap(prediction: LabelledVideo, truth: LabelledVideo) -> list[float]:
    return [float(each) for each in average_precisions(compare(prediction, truth))]


TWO = video([box(1, 0), box(2, 500)])


def test_all_found_and_nothing_else_is_1_at_every_threshold() -> None:
    assert ap(TWO, TWO) == [1] * 10


def test_one_of_two_found_reaches_51_of_the_101_recalls() -> None:
    assert ap(video([box(1, 0)]), TWO) == pytest.approx([51 / 101] * 10)


def test_a_false_alarm_with_the_lowest_score_costs_nothing() -> None:
    found = video([box(1, 0, 0.9), box(2, 500, 0.8), box(3, 900, 0.1)])
    assert ap(found, TWO)[0] == 1


def test_a_false_alarm_with_the_highest_score_costs_at_every_recall() -> None:
    # precision after each prediction: 0, 1/2, 2/3; the best from any recall on is 2/3
    found = video([box(1, 0, 0.7), box(2, 500, 0.6), box(3, 900, 0.9)])
    assert ap(found, TWO)[0] == pytest.approx(2 / 3)


def test_the_prediction_with_the_higher_score_takes_the_vehicle_even_if_it_overlaps_less() -> None:
    # 0.9 overlaps by 0.6, 0.5 by 1: at IoU 0.5 right then wrong, at 0.65 wrong then right.
    found = video([box(1, 0, 0.9, width=60), box(2, 0, 0.5)])
    precisions = ap(found, video([box(1, 0)]))
    assert precisions[0] == 1
    assert precisions[3] == pytest.approx(1 / 2)


def test_a_loose_box_counts_at_the_thresholds_below_its_overlap() -> None:
    # IoU 0.72: right at 0.50, 0.55 … 0.70
    assert ap(video([box(1, 0, width=72)]), video([box(1, 0)])) == [1] * 5 + [0] * 5


def test_a_vehicle_of_another_frame_is_not_found() -> None:
    assert ap(video([box(1, 0, frame=2)]), video([box(1, 0)])) == [0] * 10


@pytest.mark.parametrize(("found", "truth"), [(video(), TWO), (TWO, video()), (video(), video())])
def test_without_predictions_or_vehicles_it_is_0(
    found: LabelledVideo, truth: LabelledVideo
) -> None:
    assert ap(found, truth) == [0] * 10

"""Scores of pictures, with boxes whose matches are known by eye."""

from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vdet.boxes import Box, Boxes
from vdet.evaluate.results import Counting, ImageScores, MeasuredImage, MeasuredSet, mean_scores
from vdet.labels.images import LabelledImage, LabelledImages
from vdet.track.track import Track

PLAIN = Counting(score=0.5, min_width=0)
WIDTH = 1000


def at(x: float, width: float = 100) -> Box:
    return Box(x, 0, x + width, 100)


@dataclass(frozen=True)
class Searched:
    """True boxes, found ones with their scores, and the rows of ignore regions."""

    true: list[Box]
    found: list[tuple[float, Box]]
    ignored: tuple[int, ...] = ()

    def measured(self, counting: Counting) -> MeasuredImage:
        labels = (
            Track(0, box, 1.0, "detected", "car", ignored=row in self.ignored)
            for row, box in enumerate(self.true)
        )
        picture = LabelledImage(Path("a.png"), Path("a.txt"), tuple(labels))
        boxes = np.array([astuple(box) for _, box in self.found]).reshape(-1, 4)
        scores = np.array([score for score, _ in self.found])
        return MeasuredImage.of(picture, WIDTH, Boxes(boxes, scores), counting)


def source(*pictures: Searched, counting: Counting = PLAIN) -> MeasuredSet:
    measured = [picture.measured(counting) for picture in pictures]
    labelled = LabelledImages("set", tuple(item.labelled for item in measured))
    return MeasuredSet(labelled, measured)


def scores(*pictures: Searched, counting: Counting = PLAIN) -> ImageScores:
    return source(*pictures, counting=counting).scores


def test_the_same_places_in_two_pictures_are_not_the_same_vehicles() -> None:
    """In video, a pair of the frame before stays together; pictures know no frame before."""
    first = Searched([at(0), at(300)], [(0.9, at(0)), (0.8, at(300))])
    second = Searched([at(300), at(0)], [(0.9, at(300)), (0.8, at(0)), (0.7, at(20))])
    assert scores(first, second).mean_iou == pytest.approx(1)


def test_only_boxes_of_the_score_and_above_count() -> None:
    found = scores(Searched([at(0), at(300)], [(0.5, at(0)), (0.49, at(300))]))
    assert (found.matches, found.recall, found.precision) == (1, 0.5, 1)
    assert found.ap50 == pytest.approx(1), "the average precision takes all scores"


@pytest.mark.parametrize(
    ("true", "found", "counts"),
    [
        ([at(0), at(300, 49)], [], (1, 0, 0)),  # a narrower vehicle need not be found
        ([at(0)], [(0.9, at(0)), (0.8, at(300, 49)), (0.7, at(600, 50))], (1, 1, 1)),
        ([at(0, 60)], [(0.9, at(0, 45))], (1, 1, 0)),  # a narrower box may find a wider vehicle
    ],
)
def test_vehicles_and_boxes_narrower_than_the_minimum_do_not_count(
    true: list[Box], found: list[tuple[float, Box]], counts: tuple[int, int, int]
) -> None:
    result = scores(Searched(true, found), counting=Counting(score=0.5, min_width=0.05))
    assert (result.vehicles, result.matches, result.false_positives) == counts


class TestBestF1:
    def test_it_is_at_the_score_that_parts_right_from_wrong(self) -> None:
        found = [(0.4, at(0)), (0.3, at(300)), (0.2, at(600)), (0.1, at(800))]
        result = scores(Searched([at(0), at(300)], found))
        assert (result.f1, result.best_f1, result.best_score) == (0, 1, 0.3)

    lists = st.lists(
        st.tuples(
            st.sampled_from([0.2, 0.4, 0.5, 0.6, 0.8]),
            st.builds(at, st.integers(0, 20).map(lambda step: 25.0 * step)),
        ),
        max_size=6,
    )

    @settings(max_examples=50)
    @given(st.lists(lists, min_size=1, max_size=3))
    def test_it_is_the_f1_at_its_score_and_none_shown_is_better(
        self, pictures: list[list[tuple[float, Box]]]
    ) -> None:
        searched_ones = [Searched([at(0), at(130), at(300)], found) for found in pictures]
        result = scores(*searched_ones)
        if not result.best_score:
            assert not any(pictures)
            return
        again = scores(*searched_ones, counting=Counting(result.best_score, 0))
        assert again.f1 == pytest.approx(result.best_f1)
        assert result.best_f1 >= result.f1


class TestMean:
    def test_ratios_are_means_of_the_sources_with_vehicles_and_counts_are_sums(self) -> None:
        good = source(Searched([at(0)], [(0.9, at(0))]))
        bad = source(Searched([at(0), at(300), at(600)], []))
        empty = source(Searched([], [(0.9, at(0))]))
        assert (empty.scores.f1, empty.scores.false_positives) == (0, 1)
        mean = mean_scores([good, bad, empty])
        assert (mean.images, mean.vehicles, mean.matches, mean.false_positives) == (3, 4, 1, 1)
        assert (mean.recall, mean.f1) == (0.5, 0.5)

    def test_the_best_f1_is_at_one_score_for_all(self) -> None:
        low = source(Searched([at(0)], [(0.3, at(0)), (0.1, at(500))]))
        high = source(Searched([at(0)], [(0.8, at(0)), (0.6, at(500)), (0.5, at(700))]))
        assert (low.scores.best_score, high.scores.best_score) == (0.3, 0.8)
        mean = mean_scores([low, high])
        assert mean.best_score == 0.3
        assert mean.best_f1 == pytest.approx((1 + 0.5) / 2)

"""Vehicles from votes around known boxes."""

from collections.abc import Sequence

import numpy as np
import pytest

from boxing import moved_to
from vdet.boxes import Box, from_xywh
from vdet.detect.svm.detector import MAX_VOTES, HotRegion, Votes, split_regions
from vdet.detect.svm.windows import Windows

Vote = tuple[float, float, float, float, float]
"""x, y, width, height, weight."""

LEFT, RIGHT = (
    Box.sized(100, 100, 80, 60),
    Box.sized(160, 96, 90, 66),
)  # side by side, a third in common
EVERYWHERE = Box.sized(-1000, -1000, 5000, 5000)


def votes_of(*votes: Vote) -> Votes:
    """Return votes whose weights for presence and position are equal."""
    table = np.array(votes, np.float64).reshape(-1, 5)
    return Votes(from_xywh(table[:, :4]), table[:, 4], table[:, 4])


def around(box: Box, weight: float = 0.1, seed: int = 0, count: int = 12) -> list[Vote]:
    """Draw votes for a vehicle, each a few pixels off."""
    off = np.random.default_rng(seed).normal(scale=0.04 * box.width, size=(count, 4))
    true = np.array([box.x1, box.y1, box.width, box.height])
    return [(x, y, width, height, weight) for x, y, width, height in (true + off).tolist()]


def exactly(box: Box, weight: float) -> Vote:
    return box.x1, box.y1, box.width, box.height, weight


def split(votes: Sequence[Vote], *regions: Box, minimum: float = 0.12) -> list[HotRegion]:
    """Return the vehicles in regions; by default in one region that covers all votes."""
    hot = [HotRegion(box, box.center, 1.0) for box in regions or [EVERYWHERE]]
    return split_regions(hot, votes_of(*votes), minimum)


def boxes(regions: list[HotRegion]) -> list[Box]:
    return [region.box for region in regions]


def test_two_vehicles_that_overlap_are_told_apart() -> None:
    found = split(around(LEFT, seed=1) + around(RIGHT, seed=2), LEFT.union(RIGHT))
    assert len(found) == 2
    left, right = sorted(boxes(found), key=lambda box: box.x1)
    assert left.iou(LEFT) > 0.9
    assert right.iou(RIGHT) > 0.9


class TestWeights:
    def test_the_strength_is_the_weight_of_the_votes_that_agree(self) -> None:
        other = moved_to(LEFT, 110, 100)
        (vehicle,) = split([exactly(LEFT, 0.5), exactly(other, 0.25)])
        assert vehicle.strength == pytest.approx(0.5 + 0.25 * LEFT.iou(other))

    @pytest.mark.parametrize(("minimum", "count"), [(0, 1), (0.299, 1), (0.301, 0)])
    def test_a_vehicle_needs_a_least_weight(self, minimum: float, count: int) -> None:
        assert len(split([exactly(LEFT, 0.1)] * 3, minimum=minimum)) == count

    def test_presence_and_position_have_weights_of_their_own(self) -> None:
        off = moved_to(LEFT, 120, 100)
        table = np.array([exactly(LEFT, 0)[:4], exactly(off, 0)[:4]], np.float64)
        presence, position = np.array([0.2, 0.6]), np.array([1e4, 1.0])
        votes = Votes(from_xywh(table), presence, position)
        (vehicle,) = split_regions([HotRegion(EVERYWHERE, (0, 0), 1)], votes, 0.12)
        assert vehicle.box == LEFT
        assert vehicle.strength == pytest.approx(0.2 + 0.6 * LEFT.iou(off))


class TestParts:
    BONNET = Box.sized(110, 130, 36, 28)  # in LEFT

    def test_a_part_found_after_its_vehicle_is_not_reported(self) -> None:
        found = split(around(LEFT, 0.1) + around(self.BONNET, 0.05, seed=3))
        assert len(found) == 1
        assert found[0].box.iou(LEFT) > 0.8

    def test_a_box_far_stronger_than_the_one_around_it_is_a_vehicle(self) -> None:
        found = split([exactly(LEFT, 0.2), exactly(self.BONNET, 1)])
        assert boxes(found) == [self.BONNET, LEFT]

    def test_a_part_found_in_another_region_is_not_reported(self) -> None:
        left, right = Box.sized(100, 100, 60, 60), Box.sized(160, 100, 20, 60)
        part = Box.sized(162, 110, 16, 30)
        found = split([exactly(LEFT, 1), exactly(part, 0.5)], left, right)
        assert boxes(found) == [LEFT]


@pytest.mark.parametrize(
    "aside", [(Box.sized(130, 90, 100, 100),), (Box.sized(400, 90, 9, 9), EVERYWHERE)]
)
def test_regions_that_overlap_do_not_count_a_vote_twice(aside: tuple[Box, ...]) -> None:
    votes = around(LEFT)
    (alone,) = split(votes)
    assert split(votes, Box.sized(90, 90, 100, 100), *aside) == [alone]


class TestCollecting:
    def test_presence_is_probability_times_weight_for_the_hits_of_all_frames(self) -> None:
        def windows(count: int, x: int) -> Windows:
            vehicles = np.tile(np.array([x, 0, 10, 20], np.float32), (count, 1))
            vehicles[:, 0] += np.arange(count)
            values = np.linspace(0.5, 1, count, dtype=np.float32)
            weights = np.asarray(values / 4, np.float32)
            return Windows(np.zeros((count, 4), np.int32), values, weights, vehicles)

        votes = Votes.of((windows(2, 0), windows(0, 0), windows(1, 50)), (100, 100))
        assert votes.boxes.tolist() == [[0, 0, 10, 20], [1, 0, 11, 20], [50, 0, 60, 20]]
        assert votes.presence.tolist() == [0.5 * 0.125, 1 * 0.25, 0.5 * 0.125]
        assert votes.boxes.dtype == votes.presence.dtype == votes.position.dtype == np.float64

    def test_of_too_many_votes_the_best_positioned_are_kept_in_their_order(self) -> None:
        rng = np.random.default_rng(0)
        weights = rng.permutation(MAX_VOTES + 100) / 1000
        votes = votes_of(*((i, 0, 10, 10, weight) for i, weight in enumerate(weights.tolist())))
        kept = votes.within([EVERYWHERE])
        assert len(kept.position) == MAX_VOTES
        assert kept.position.min() == 0.1
        assert (np.diff(kept.boxes[:, 0]) > 0).all()

import numpy as np

from vdet.learn.extraction import LabelledVectors, Views
from vdet.learn.training_set import lesson_of


def column(*values: float) -> np.ndarray:
    return np.array(values, np.float32)[:, np.newaxis]


def data(views: Views | None) -> LabelledVectors:
    """Give five patches whose one feature is their number, in tens."""
    vehicle = np.array([True, False, True, False, True])
    sides = np.full((5, 4), np.nan, np.float32)
    sides[0] = 0.5
    groups = np.array(["a"] * 5)
    return LabelledVectors(column(0, 10, 20, 30, 40), vehicle, groups, "", 0, sides, views)


VIEWS = Views(
    column(1, 11, 12, 21, 41),
    np.array([True, False, False, False, True]),
    np.arange(20, dtype=np.float32).reshape(5, 4),
    np.array([0, 1, 1, 2, 4]),
)
KEPT = np.array([False, True, True, False, True])


def test_only_the_kept_patches_and_their_views_are_learnt_from() -> None:
    lesson = lesson_of(data(VIEWS), KEPT)
    assert lesson.vectors[:, 0].tolist() == [10, 20, 40, 11, 12, 21, 41]
    assert lesson.vehicle.tolist() == [False, True, True, False, False, False, True]
    assert lesson.sides[3:, 0].tolist() == [4, 8, 12, 16]


def test_a_view_knows_the_row_of_its_patch_among_the_kept() -> None:
    lesson = lesson_of(data(VIEWS), KEPT)
    assert lesson.origins.tolist() == [0, 1, 2, 0, 0, 1, 2]
    np.testing.assert_array_equal(lesson.vectors[lesson.origins] // 10, lesson.vectors // 10)


def test_without_views_there_are_the_patches() -> None:
    lesson = lesson_of(data(None), KEPT)
    assert lesson.vectors[:, 0].tolist() == [10, 20, 40]
    assert lesson.origins.tolist() == [0, 1, 2]


def test_without_boxes_no_side_is_known() -> None:
    bare = LabelledVectors(column(0, 1), np.array([True, False]), np.array(["a", "b"]), "", 0)
    assert np.isnan(lesson_of(bare, np.array([True, True])).sides).all()

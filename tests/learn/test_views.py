import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.config.schema import ViewSettings
from vdet.learn.augmentation import View, closer, cut_off, mirrored, views_of

NOISE = np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8)
OFF = ViewSettings(mirror=False, cut=0, parts=0)
ALL = ViewSettings(mirror=True, cut=1, parts=1)


def patch(*sides: float, vehicle: bool = True) -> View:
    return View(NOISE, vehicle, np.array(sides or (np.nan,) * 4, np.float32))


def views(settings: ViewSettings, view: View | None = None, seed: int = 0) -> list[View]:
    return list(views_of(view or patch(), (seed,), settings))


def test_with_everything_off_there_are_no_views() -> None:
    assert views(OFF) == []


def test_a_mirror_turns_the_picture_and_its_box() -> None:
    view = mirrored(patch(-0.4, -0.3, 0.2, 0.1))
    np.testing.assert_array_equal(view.image, NOISE[:, ::-1])
    np.testing.assert_allclose(view.sides, [-0.2, -0.3, 0.4, 0.1], rtol=1e-6)


def test_what_is_not_known_of_a_side_is_not_known_of_the_other_in_the_mirror() -> None:
    np.testing.assert_array_equal(
        np.isnan(mirrored(patch(-0.4, -0.3, np.nan, 0.1)).sides), [True, False, False, False]
    )


@given(st.tuples(*[st.floats(-2, 2, width=32)] * 4))
def test_the_mirror_of_the_mirror_is_the_patch(sides: tuple[float, ...]) -> None:
    twice = mirrored(mirrored(patch(*sides)))
    np.testing.assert_array_equal(twice.image, NOISE)
    np.testing.assert_array_equal(twice.sides, np.array(sides, np.float32))


@pytest.mark.parametrize("vehicle", [True, False])
def test_a_cut_repeats_the_outermost_column_that_is_left(vehicle: bool) -> None:
    right = cut_off(patch(vehicle=vehicle), 0.25, left=False)
    np.testing.assert_array_equal(right.image[:, :48], NOISE[:, :48])
    np.testing.assert_array_equal(right.image[:, 48:], np.repeat(NOISE[:, 47:48], 16, axis=1))
    left = cut_off(patch(vehicle=vehicle), 0.25, left=True)
    np.testing.assert_array_equal(left.image[:, 16:], NOISE[:, 16:])
    np.testing.assert_array_equal(left.image[:, :16], np.repeat(NOISE[:, 16:17], 16, axis=1))
    assert right.vehicle is left.vehicle is vehicle


def test_a_side_beyond_the_cut_is_not_known_any_more() -> None:
    whole = patch(-0.4, -0.3, 0.2, 0.1)
    for view, unknown in (
        (cut_off(whole, 0.375, left=False), [False, False, True, False]),
        (cut_off(whole, 0.25, left=False), [False] * 4),
        (cut_off(whole, 0.25, left=True), [True, False, False, False]),
    ):
        np.testing.assert_array_equal(np.isnan(view.sides), unknown)
        np.testing.assert_array_equal(
            view.sides[~np.isnan(view.sides)], whole.sides[~np.array(unknown)]
        )


def test_the_other_views_are_of_the_patch_and_of_its_mirror_image() -> None:
    mirror, *others = views(ALL)
    np.testing.assert_array_equal(mirror.image, NOISE[:, ::-1])
    assert [view.vehicle for view in others] == [True, False, True, False]
    assert len(views(ALL.model_copy(update={"mirror": False}))) == 2


def test_of_a_non_vehicle_there_are_no_parts() -> None:
    assert [view.vehicle for view in views(ALL, patch(vehicle=False))] == [False] * 3


def test_a_cut_takes_15_to_50_percent_of_either_side() -> None:
    only = OFF.model_copy(update={"cut": 1})
    left = []
    for seed in range(40):
        (view,) = views(only, patch(-0.5, -0.5, 0.5, 0.5), seed)
        kept = (view.image == NOISE).all(axis=(0, 2))
        assert 32 <= np.count_nonzero(kept) <= 55  # one more: the column that is repeated
        left.append(not kept[0])
        assert np.isnan(view.sides).tolist() == [left[-1], False, not left[-1], False]
    assert 10 < sum(left) < 30


def test_a_part_is_a_crop_of_40_to_60_percent_without_a_box() -> None:
    only = OFF.model_copy(update={"parts": 1})
    windows = np.lib.stride_tricks.sliding_window_view(NOISE[:, :, 0], (26, 26))
    for seed in range(20):
        (view,) = views(only, patch(-0.5, -0.5, 0.5, 0.5), seed)
        assert view.image.shape[0] == view.image.shape[1]
        assert 26 <= len(view.image) <= 38
        assert (windows == view.image[:26, :26, 0]).all(axis=(2, 3)).any()
        assert not view.vehicle
        assert np.isnan(view.sides).all()


@pytest.mark.parametrize("name", ["cut", "parts"])
def test_a_share_of_the_patches_has_views(name: str) -> None:
    settings = OFF.model_copy(update={name: 0.25})
    with_one = sum(len(views(settings, seed=seed)) for seed in range(1000))
    assert 200 < with_one < 300


def test_the_same_seed_gives_the_same_views_whatever_else_is_on() -> None:
    part = views(OFF.model_copy(update={"parts": 1}), seed=3)[0]
    same = views(ALL.model_copy(update={"mirror": False}), seed=3)[1]
    other = views(OFF.model_copy(update={"parts": 1}), seed=4)[0]
    np.testing.assert_array_equal(part.image, same.image)
    assert part.image.shape != other.image.shape or (part.image != other.image).any()


def test_closer_a_box_moves_and_grows_with_its_vehicle() -> None:
    image = np.zeros((64, 64, 3), np.uint8)
    image[20:40, 24:44] = 255
    box = (np.array([24, 20, 44, 40]) / 64 - 0.5).astype(np.float32)
    for seed in range(20):
        (view,) = closer(View(image, True, box), (seed,))
        side = len(view.image)
        assert 38 <= side <= 64
        rows, columns = (np.flatnonzero(view.image[:, :, 0].any(axis=axis)) for axis in (1, 0))
        edges = np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1])
        inside = (edges > 0) & (edges < side)
        np.testing.assert_allclose(view.sides[inside], (edges / side - 0.5)[inside], atol=1e-5)


def test_a_patch_need_not_be_square() -> None:
    wide = View(
        np.ascontiguousarray(NOISE[:32]), True, np.array([-0.5, -0.5, 0.5, 0.5], np.float32)
    )
    (view,) = closer(wide, (0,))
    height, width = view.image.shape[:2]
    assert abs(width - 2 * height) <= 1
    extent = view.sides[2:] - view.sides[:2]
    np.testing.assert_allclose(extent, [64 / width, 32 / height], rtol=1e-5)

import numpy as np
import pytest

from vdet.learn.svm.patches import PatchSample, augment, cut_off, mirrored

NOISE = np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8)


def patch(*sides: float, vehicle: bool = True) -> PatchSample:
    return PatchSample(NOISE, vehicle, np.array(sides or (np.nan,) * 4, np.float32))


def augmented(
    monkeypatch: pytest.MonkeyPatch, seed: int, cut: float, part: float
) -> list[PatchSample]:
    monkeypatch.setattr("vdet.learn.svm.patches.CUT", cut)
    monkeypatch.setattr("vdet.learn.svm.patches.PART", part)
    return list(augment(patch(-0.5, -0.5, 0.5, 0.5), np.random.default_rng(seed)))


def test_a_mirror_image_flips_the_picture_and_its_box() -> None:
    sample = mirrored(patch(-0.4, -0.3, 0.2, 0.1))
    np.testing.assert_array_equal(sample.image, NOISE[:, ::-1])
    np.testing.assert_allclose(sample.sides, [-0.2, -0.3, 0.4, 0.1], rtol=1e-6)


@pytest.mark.parametrize("vehicle", [True, False])
def test_a_cut_repeats_the_outermost_column_that_is_left(vehicle: bool) -> None:
    right = cut_off(patch(vehicle=vehicle), 0.25, left=False)
    np.testing.assert_array_equal(right.image[:, :48], NOISE[:, :48])
    np.testing.assert_array_equal(right.image[:, 48:], np.repeat(NOISE[:, 47:48], 16, axis=1))
    left = cut_off(patch(vehicle=vehicle), 0.25, left=True)
    np.testing.assert_array_equal(left.image[:, 16:], NOISE[:, 16:])
    np.testing.assert_array_equal(left.image[:, :16], np.repeat(NOISE[:, 16:17], 16, axis=1))
    assert right.vehicle is left.vehicle is vehicle


def test_a_side_beyond_the_cut_becomes_unknown() -> None:
    whole = patch(-0.4, -0.3, 0.2, 0.1)
    for sample, unknown in (
        (cut_off(whole, 0.375, left=False), [False, False, True, False]),
        (cut_off(whole, 0.25, left=False), [False] * 4),
        (cut_off(whole, 0.25, left=True), [True, False, False, False]),
    ):
        np.testing.assert_array_equal(np.isnan(sample.sides), unknown)
        np.testing.assert_array_equal(
            sample.sides[~np.isnan(sample.sides)], whole.sides[~np.array(unknown)]
        )


def test_the_other_samples_are_made_of_the_patch_and_of_its_mirror_image(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mirror, *others = augmented(monkeypatch, 0, cut=1, part=1)
    np.testing.assert_array_equal(mirror.image, NOISE[:, ::-1])
    assert [sample.vehicle for sample in others] == [True, False, True, False]
    assert len(augmented(monkeypatch, 0, cut=0, part=0)) == 1

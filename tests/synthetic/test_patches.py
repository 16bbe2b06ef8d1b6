from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from vdet.learn.svm.dataset import find_patches
from vdet.synthetic.patches import draw_patches, write_patches

Float64Array = npt.NDArray[np.float64]


@pytest.mark.parametrize("vehicles", [True, False])
def test_patches_are_64_pixels_bgr_and_all_differ(vehicles: bool) -> None:
    patches = [patch for _, patch in draw_patches(20, np.random.default_rng(0), vehicles=vehicles)]
    assert {(patch.shape, patch.dtype) for patch in patches} == {((64, 64, 3), np.dtype(np.uint8))}
    assert len({patch.tobytes() for patch in patches}) == 20


def test_the_layout_is_that_of_the_data_set_with_groups_of_equal_size(tmp_path: Path) -> None:
    write_patches(tmp_path, seed=0, vehicles=21, non_vehicles=20)
    names = sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.png"))
    groups = [name.rpartition("/")[0] for name in names]
    assert {group: groups.count(group) for group in groups} == {
        "non-vehicles/parts": 7,
        "non-vehicles/road": 6,
        "non-vehicles/roadside": 7,
        "vehicles/far": 11,
        "vehicles/near": 10,
    }
    assert "vehicles/near/image0001.png" in names
    assert "vehicles/far/image0011.png" in names


def test_the_data_set_reader_finds_both_classes(tmp_path: Path) -> None:
    write_patches(tmp_path, seed=0, vehicles=4, non_vehicles=6)
    found = find_patches([tmp_path])
    assert sum(file.vehicle for file in found) == 4
    assert sum(not file.vehicle for file in found) == 6


def test_files_of_the_same_seed_are_equal_to_the_byte(tmp_path: Path) -> None:
    for name in ("one", "two"):
        write_patches(tmp_path / name, seed=9, vehicles=4, non_vehicles=6)
    first = sorted((tmp_path / "one").rglob("*.png"))
    assert len(first) == 10
    for path in first:
        other = tmp_path / "two" / path.relative_to(tmp_path / "one")
        assert path.read_bytes() == other.read_bytes()


def test_a_linear_model_can_separate_vehicles_from_background() -> None:
    """Ridge regression on coarse gradients: far better than chance on patches of other roads."""
    train, test = (_described(seed) for seed in (0, 1))
    vectors, labels = train
    inner = vectors @ vectors.T + 3 * np.eye(len(vectors))
    weights = vectors.T @ np.linalg.solve(inner, labels)
    right = np.sign(test[0] @ weights) == test[1]
    assert right.mean() > 0.85


def _described(seed: int) -> tuple[Float64Array, Float64Array]:
    rng = np.random.default_rng(seed)
    drawn = [*draw_patches(80, rng, vehicles=True), *draw_patches(80, rng, vehicles=False)]
    hog = cv2.HOGDescriptor((64, 64), (16, 16), (8, 8), (8, 8), 8)
    grey = [cv2.cvtColor(patch, cv2.COLOR_BGR2GRAY) for _, patch in drawn]
    vectors = np.array([np.ravel(hog.compute(patch)) for patch in grey])
    return vectors - vectors.mean(), np.repeat([1.0, -1.0], 80)

import math
from pathlib import Path

import numpy as np
import pytest

from vdet.boxes import Image
from vdet.learn.svm.dataset import Sides, find_patches, patch_archive, read_patches

NAMES = ("vehicles/a/1.png", "boxes/a/2.png", "non-vehicles/a/3.png")
BOXES: tuple[Sides | None, ...] = ((-0.5, -0.25, 0.5, 0.12344), (math.nan, -0.25, 0.5, 0.0), None)


def patch(number: int) -> Image:
    return np.random.default_rng(number).integers(0, 256, (8, 8, 3), dtype=np.uint8)


def write(path: Path) -> Path:
    with patch_archive(path) as add:
        for number, (name, sides) in enumerate(zip(NAMES, BOXES, strict=True)):
            add(name, patch(number), sides)
    return path


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    path = write(tmp_path / "a.zip")
    files = find_patches([path])
    assert {file.name: file.sides for file in files} == {
        NAMES[0]: (-0.5, -0.25, 0.5, 0.1234),
        NAMES[1]: pytest.approx(BOXES[1], nan_ok=True),
        NAMES[2]: None,
    }
    for file, image in zip(files, read_patches(files), strict=True):
        np.testing.assert_array_equal(image, patch(NAMES.index(file.name)))


def test_the_same_patches_give_the_same_bytes(tmp_path: Path) -> None:
    assert write(tmp_path / "a.zip").read_bytes() == write(tmp_path / "b.zip").read_bytes()

"""The evaluation of the classifier on patches."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from vdet.config.detector import FeatureSettings, HistogramSettings
from vdet.config.schema import Settings, SvmSettings, SvmTrainingSettings, TrainSettings
from vdet.learn.svm.dataset import find_patches
from vdet.learn.svm.training import evaluate_patches
from writing import write_image

FEATURES = FeatureSettings(patch=16, histogram=HistogramSettings(bins=8))
SETTINGS = Settings(
    detector=SvmSettings(features=FEATURES), train=TrainSettings(svm=SvmTrainingSettings(C=1))
)


@pytest.fixture
def bright_and_dark(tmp_path: Path) -> Path:
    """Vehicles are bright, other things dark, in two groups each of 12 patches."""
    random = np.random.default_rng(0)
    for class_, level in (("vehicles", 180), ("non-vehicles", 60)):
        for group in ("a", "b"):
            folder = tmp_path / class_ / group
            folder.mkdir(parents=True)
            for number in range(12):
                image = (
                    random.normal(level, 20, (16, 16, 1))
                    .repeat(3, axis=2)
                    .clip(0, 255)
                    .astype(np.uint8)
                )
                write_image(folder / f"{number}.png", image)
    return tmp_path


def test_a_new_model_is_tested_on_the_last_patches_of_each_folder(bright_and_dark: Path) -> None:
    vehicle = bright_and_dark / "vehicles" / "a" / "0.png"
    shutil.copy(vehicle, bright_and_dark / "non-vehicles" / "b" / "11.png")
    steps: list[tuple[str, int | None]] = []

    def start(what: str, total: int | None) -> Callable[[int], object]:
        steps.append((what, total))
        return lambda _: None

    files = find_patches([bright_and_dark])
    found = evaluate_patches(files, SETTINGS, jobs=1, steps=start)
    assert (found.patches, found.accuracy) == (8, 7 / 8)
    assert found.groups["non-vehicles/b"] == 0.5
    assert steps == [("describing patches", 48), ("fitting the classifier", None)]

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vdet.config.schema import (
    FeatureSettings,
    HistogramSettings,
    HogSettings,
    Settings,
    SvmSettings,
    SvmTrainingSettings,
    TrainSettings,
)
from vdet.learn.svm.dataset import find_patches
from vdet.learn.svm.patch_eval import evaluate_model, evaluate_splits
from vdet.learn.svm.training import train
from vdet.media.images import write_image

FEATURES = FeatureSettings(
    patch=16, hog=HogSettings(channels=()), histogram=HistogramSettings(bins=8)
)
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
                image = random.normal(level, 20, (16, 16, 3)).clip(0, 255).astype(np.uint8)
                write_image(folder / f"{number}.png", image)
    return tmp_path


def test_each_split_is_tested_in_the_order_given(bright_and_dark: Path) -> None:
    steps: list[tuple[str, int | None]] = []

    def start(what: str, total: int | None) -> Callable[[int], object]:
        steps.append((what, total))
        return lambda _: None

    report = evaluate_splits(
        find_patches([bright_and_dark]), SETTINGS, ("tail", "groups"), jobs=1, steps=start
    )
    assert [trial.name for trial in report.trials] == ["tail", "groups"]
    assert [trial.scores.patches for trial in report.trials] == [8, 48]
    expected = [("describing patches", 48), ("fitting models", 1 + 4), ("computing scores", None)]
    assert steps == expected
    assert [trial.scores.accuracy for trial in report.trials] == [1, 1]


def test_mistakes_have_the_right_names_beside_a_broken_patch(bright_and_dark: Path) -> None:
    (bright_and_dark / "non-vehicles" / "a" / "3.png").write_bytes(b"broken")
    light = np.full((16, 16, 3), 180, np.uint8)
    write_image(bright_and_dark / "non-vehicles" / "b" / "7.png", light, overwrite=True)
    tolerant = SETTINGS.model_copy(
        update={
            "train": TrainSettings(svm=SETTINGS.train.svm.model_copy(update={"max_broken": 0.1}))
        }
    )
    report = evaluate_splits(find_patches([bright_and_dark]), tolerant, ("groups",), jobs=1)
    (mistake,) = report.trials[0].mistakes
    assert str(mistake.file).endswith("non-vehicles/b/7.png")
    assert (report.broken, report.vehicles, report.non_vehicles) == (1, 24, 23)


@pytest.mark.parametrize(
    ("digest", "words"),
    [
        (None, "was trained on most of these very patches"),
        ("other", "was trained on another set of patches"),
        ("", "does not say what it was trained on"),
    ],
)
def test_the_report_tells_what_the_model_was_trained_on(
    bright_and_dark: Path, digest: str | None, words: str
) -> None:
    files = find_patches([bright_and_dark])
    model, _ = train(files, SETTINGS, jobs=1)
    if digest is not None:
        model = replace(model, provenance={"data_sha256": digest} if digest else {})
    (trial,) = evaluate_model(files, model, SETTINGS, jobs=1).trials
    assert words in trial.meaning
    assert trial.scores.patches == 48

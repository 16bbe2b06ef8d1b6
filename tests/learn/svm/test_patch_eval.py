"""The evaluation of the classifier on patches."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pages.html import Elements
from vdet.config.schema import Settings, SvmSettings, TrainSettings
from vdet.config.svm import FeatureSettings, HistogramSettings
from vdet.config.train import SvmTrainingSettings
from vdet.evaluate.output import RunName
from vdet.learn.svm.dataset import PatchFile, find_patches
from vdet.learn.svm.patch_eval import (
    MOST_MISTAKES,
    PatchScores,
    evaluate_patches,
    lines,
    patch_page,
    score_patches,
    values,
)
from vdet.learn.svm.training import train
from vdet.media.images import write_image

FEATURES = FeatureSettings(patch=16, histogram=HistogramSettings(bins=8))
SETTINGS = Settings(
    detector=SvmSettings(features=FEATURES),
    train=TrainSettings(svm=SvmTrainingSettings(C=1)),
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


def scores_of(vehicle: list[bool], probabilities: list[float]) -> PatchScores:
    """Return the scores of patches 0, 1, 2 … in one group per class."""
    files = [
        PatchFile(Path("set"), f"{row}.png", "vehicles/a" if flag else "non-vehicles/a", flag)
        for row, flag in enumerate(vehicle)
    ]
    return score_patches(files, np.array(probabilities), "a test")


def test_a_new_model_is_tested_on_the_last_patches_of_each_folder(bright_and_dark: Path) -> None:
    light = np.full((16, 16, 3), 180, np.uint8)
    write_image(bright_and_dark / "non-vehicles" / "b" / "11.png", light, overwrite=True)
    steps: list[tuple[str, int | None]] = []

    def start(what: str, total: int | None) -> Callable[[int], object]:
        steps.append((what, total))
        return lambda _: None

    files = find_patches([bright_and_dark])
    scores = evaluate_patches(files, SETTINGS, jobs=1, steps=start)
    (mistake,) = scores.mistakes
    assert str(mistake.file).endswith("non-vehicles/b/11.png")
    assert (scores.test.patches, scores.test.accuracy.value) == (8, 7 / 8)
    assert scores.test.groups["non-vehicles/b"].value == 0.5
    assert "leak-free" in scores.meaning
    assert steps == [("describing patches", 48), ("fitting the classifier", None)]
    page = Elements(patch_page(scores, RunName("svm", None, None, ())))
    assert len(page.all("img")) == 1
    for words in ("11.png", "ROC AUC", "non-vehicles/b"):
        assert words in page.text


def test_a_ready_model_is_tested_on_all_patches(bright_and_dark: Path) -> None:
    files = find_patches([bright_and_dark])
    model, _ = train(files, SETTINGS, jobs=1)
    scores = evaluate_patches(files, SETTINGS, model, jobs=1)
    assert "if the model was trained on some of these patches" in scores.meaning
    assert scores.test.patches == 48


def test_the_metrics_are_those_of_the_definition() -> None:
    scores = scores_of([True, True, False, False], [0.9, 0.4, 0.6, 0.2])
    assert scores.test.confusion == [[1, 1], [1, 1]]
    assert (scores.precision.value, scores.recall.value, scores.roc_auc) == (0.5, 0.5, 0.75)
    assert scores.log_loss == pytest.approx(-np.log([0.9, 0.4, 0.4, 0.8]).mean())


def test_patches_of_one_class_have_no_ranking() -> None:
    scores = scores_of([False, False], [0.2, 0.1])
    assert (scores.test.accuracy.value, scores.recall.value) == (1, None)
    assert scores.roc_auc is scores.log_loss is None
    assert "None." in patch_page(scores, RunName("svm", None, None, ()))


def test_the_worst_mistakes_come_first() -> None:
    mistakes = scores_of([True, False, True, False, True], [0.3, 0.95, 0.9, 0.6, 0.01]).mistakes
    assert [(m.file.name, m.probability) for m in mistakes] == [
        *(("4.png", 0.01), ("1.png", 0.95)),
        *(("0.png", 0.3), ("3.png", 0.6)),
    ]
    many = scores_of([False] * 40 + [True], [0.99] * 40 + [0.4]).mistakes
    assert len(many) == MOST_MISTAKES + 1
    assert many[-1].file.vehicle, "mistakes of one kind do not hide the other"


def test_text_and_json_have_the_scores() -> None:
    scores = scores_of([True, True, False], [0.9, 0.2, 0.1])
    text = "\n".join(lines(scores))
    assert re.search(r"^accuracy +0\.6667 \[0\.208, 0\.939\]$", text, re.MULTILINE)
    assert "predicted non-vehicle" in text
    found = json.loads(json.dumps(values(scores), allow_nan=False))
    assert found["test"]["accuracy"].keys() == {"value", "low", "high"}
    assert found["test"]["groups"]["vehicles/a"]["value"] == 0.5
    assert found["mistakes"] == [{"file": "set: 1.png", "probability": 0.2}]

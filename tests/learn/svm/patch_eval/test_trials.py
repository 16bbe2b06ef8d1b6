import logging

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
from vdet.errors import DataError
from vdet.learn.svm.extraction import LabelledVectors, Rows
from vdet.learn.svm.fitting import fit
from vdet.learn.svm.patch_eval.trials import holdouts, model_trial, run_trial

FEATURES = FeatureSettings(
    patch=16, hog=HogSettings(channels=()), histogram=HistogramSettings(bins=8)
)
SETTINGS = Settings(
    detector=SvmSettings(features=FEATURES), train=TrainSettings(svm=SvmTrainingSettings(C=1))
)


def data(groups: dict[str, int]) -> LabelledVectors:
    """Return vectors that tell the classes apart; a group is its class, a slash, its name."""
    names = np.repeat(list(groups), list(groups.values()))
    vehicle = np.char.startswith(names, "vehicles/")
    random = np.random.default_rng(1)
    vectors = random.normal(size=(len(names), 24)).astype(np.float32)
    vectors += np.where(vehicle, 1, -1)[:, np.newaxis]
    return LabelledVectors(Rows.of_patches(vectors, vehicle), names)


FOUR = {"non-vehicles/a": 20, "non-vehicles/b": 10, "vehicles/a": 15, "vehicles/b": 20}


def test_each_group_is_held_out_in_turn() -> None:
    parts = holdouts(data(FOUR), SETTINGS, "groups")
    assert [int(part.sum()) for part in parts] == [20, 10, 15, 20]
    assert (np.sum(parts, axis=0) == 1).all()


def test_the_only_group_of_a_class_is_not_held_out(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, logger="vdet"):
        parts = holdouts(
            data({"non-vehicles/a": 9, "vehicles/a": 5, "vehicles/b": 7}), SETTINGS, "groups"
        )
    assert [int(part.sum()) for part in parts] == [5, 7]
    assert "non-vehicles/a: is the only group of its class" in caplog.text


def test_two_classes_of_one_group_cannot_be_split_by_group() -> None:
    with pytest.raises(DataError, match="split groups: nothing can be held out"):
        holdouts(data({"non-vehicles/a": 9, "vehicles/a": 5}), SETTINGS, "groups")


def test_tail_takes_the_last_of_each_group() -> None:
    (part,) = holdouts(data(FOUR), SETTINGS, "tail")
    held = np.flatnonzero(part).tolist()
    assert held == [*range(16, 20), *range(28, 30), *range(42, 45), *range(61, 65)]


def test_each_patch_is_predicted_once_by_a_model_fitted_without_its_group() -> None:
    patches = data(FOUR)
    parts = holdouts(patches, SETTINGS, "groups")
    steps: list[int] = []
    trial = run_trial("groups", patches, SETTINGS, parts, steps.append)
    assert sorted(trial.rows.tolist()) == list(range(65))
    assert (trial.fits, steps) == (4, [1, 1, 1, 1])
    held = parts[0]
    model = fit(patches.rows.of(~held), SETTINGS)
    expected = model.probabilities(patches.vectors[held])
    assert trial.probabilities[:20] == pytest.approx(expected.astype(float))
    assert ((trial.probabilities >= 0.5) == patches.vehicle[trial.rows]).mean() > 0.9


def test_a_ready_model_predicts_every_patch() -> None:
    patches = data(FOUR)
    model = fit(patches.rows.of(np.ones(65, bool)), SETTINGS)
    trial = model_trial(patches, model)
    assert trial.rows.tolist() == list(range(65))
    assert trial.probabilities == pytest.approx(model.probabilities(patches.vectors).astype(float))

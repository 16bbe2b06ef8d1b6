import logging
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from sklearn.calibration import CalibratedClassifierCV
from sklearn.model_selection import StratifiedKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import LinearSVC

from vdet.boxes import BoolArray, Float32Array
from vdet.config.kinds import FeatureSettings
from vdet.config.schema import Settings, SvmSettings, SvmTrainingSettings, TrainSettings
from vdet.detect.svm.model import LinearModel
from vdet.errors import DataError
from vdet.learn.svm.patches import LabelledVectors, PatchFile, RowNumbers
from vdet.learn.svm.training import fit as fit_rows

FEATURES = FeatureSettings()


def clouds(count: int = 300) -> tuple[Float32Array, npt.NDArray[np.bool_]]:
    """Return two overlapping clouds of features of very different scale, one of them constant."""
    rng = np.random.default_rng(0)
    vehicle = rng.random(count) < 0.4
    vectors = rng.normal(size=(count, 24)) + 0.6 * vehicle[:, np.newaxis]
    vectors = (vectors + 2) * np.logspace(-2, 3, 24)
    vectors[:, 5] = 7
    return vectors.astype(np.float32), vehicle


def labelled(vectors: Float32Array, vehicle: BoolArray, origins: RowNumbers) -> LabelledVectors:
    files = [PatchFile(Path(), f"{row}.png", "some", True) for row in range(origins.max() + 1)]
    sides = np.zeros((len(vectors), 4), np.float32)
    return LabelledVectors(vectors, vehicle, sides, origins, files)


def fit(
    vectors: Float32Array,
    vehicle: BoolArray,
    origins: RowNumbers | None = None,
    penalty: float = 0.01,
) -> LinearModel:
    """Fit to copies of vectors; without origins, all rows are patches."""
    training = SvmTrainingSettings(C=penalty)
    if origins is None:
        origins = np.arange(len(vectors))
    rows = labelled(vectors.copy(), vehicle, origins)
    return fit_rows(
        rows, Settings(detector=SvmSettings(features=FEATURES), train=TrainSettings(svm=training))
    )


def test_the_folded_model_gives_the_probabilities_of_scikit_learn() -> None:
    vectors, vehicle = clouds()
    model = fit(vectors, vehicle)
    svm = CalibratedClassifierCV(
        LinearSVC(C=0.01, random_state=0),
        cv=StratifiedKFold(3, shuffle=True, random_state=0),
        ensemble=False,
    )
    reference = make_pipeline(StandardScaler(), svm).fit(vectors, vehicle)
    expected = reference.predict_proba(vectors)[:, 1]
    assert expected.std() > 0.2
    np.testing.assert_allclose(model.probabilities(vectors), expected, atol=1e-4)
    assert model.weights.shape == (1, 24)
    assert model.biases.shape == model.slopes.shape == model.offsets.shape == (1,)
    assert model.features == FEATURES
    kinds = {a.dtype for a in (model.weights, model.biases, model.slopes, model.offsets)}
    assert kinds == {np.dtype(np.float32)}


@pytest.mark.parametrize(("vehicles", "others"), [(2, 30), (30, 0)])
def test_too_few_patches_of_a_class_for_the_folds_are_an_error(vehicles: int, others: int) -> None:
    vehicle = np.array([True] * vehicles + [False] * others, bool)
    vectors = np.ones((len(vehicle), 24), np.float32)
    message = rf"a class has {min(vehicles, others)} training patches, must be at least 3; add more"
    with pytest.raises(DataError, match=message):
        fit(vectors, vehicle)


@pytest.mark.parametrize("most", [1, 1000])
def test_an_svm_that_has_not_converged_is_reported_by_a_warning(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    monkeypatch.setattr("vdet.learn.svm.training.MAX_ITERATIONS", most)
    with caplog.at_level(logging.WARNING, "vdet"):
        fit(*clouds(), penalty=1e6 if most == 1 else 0.01)
    warning = "the SVM has not converged; lower train.svm.C"
    assert (warning in caplog.text) is (most == 1)


def test_a_patch_and_the_samples_made_of_it_are_in_the_same_fold() -> None:
    """Otherwise the SVM knows a sample like the patch, and the score of the patch is too good."""
    rng = np.random.default_rng(0)
    vehicle = np.arange(90) % 2 == 0
    noise = rng.normal(size=(90, 24)).astype(np.float32)  # can only be learned by heart
    twice = np.concatenate([noise, noise])
    origins = np.tile(np.arange(90), 2)
    honest = fit(twice, np.tile(vehicle, 2), origins, penalty=10.0)
    leaking = fit(twice, np.tile(vehicle, 2), penalty=10.0)
    np.testing.assert_allclose(honest.weights, leaking.weights, atol=1e-3)
    assert abs(leaking.slopes[0]) > 2 * abs(honest.slopes[0])


def peak_memory(call: Callable[[], object]) -> int:
    """Return the bytes that `call` had at once."""
    tracemalloc.start()
    call()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return peak


def test_a_fit_has_the_training_part_in_memory_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vdet.learn.svm.training.MAX_ITERATIONS", 5)
    rng = np.random.default_rng(0)
    origins = np.concatenate([np.arange(3000), rng.integers(0, 3000, 4500)])
    vectors = rng.normal(size=(7500, 768)).astype(np.float32)
    vehicle = (vectors[:, 0] > 0)[origins]
    rows = labelled(vectors, vehicle, origins)
    settings = Settings(detector=SvmSettings())
    peak = peak_memory(lambda: fit_rows(rows.of(np.ones(3000, bool)), settings))
    assert peak < 1.5 * vectors.nbytes

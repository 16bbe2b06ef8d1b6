"""The linear model is fitted, calibrated, and measured."""

import json
import shutil
import tracemalloc
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from sklearn.calibration import CalibratedClassifierCV
from sklearn.model_selection import StratifiedKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import LinearSVC

import vdet
from vdet.boxes import BoolArray, Float32Array, Image
from vdet.config.kinds import FeatureSettings, HistogramSettings, HogSettings
from vdet.config.schema import Settings, SvmSettings, SvmTrainingSettings, TrainSettings
from vdet.detect.svm.model import (
    BoxRegression,
    LinearModel,
    describe,
    load_model,
    save_model,
    split,
)
from vdet.errors import DataError
from vdet.learn.svm.patches import (
    LabelledVectors,
    PatchFile,
    RowNumbers,
    extract,
    find_patches,
    hold_out,
)
from vdet.learn.svm.training import Classification, fit_sides, train
from vdet.learn.svm.training import fit as fit_rows
from vdet.media.images import read_image
from writing import write_image

SIZE = 16
GROUPS = {"vehicles/far": 12, "vehicles/near": 20, "non-vehicles/road": 15, "non-vehicles/sky": 10}
SETTINGS = Settings(
    detector=SvmSettings(
        features=FeatureSettings(
            patch=SIZE, halved=(), hog=HogSettings(cell=4), histogram=HistogramSettings(bins=8)
        )
    ),
    train=TrainSettings(svm=SvmTrainingSettings(C=0.1)),
)


def texture(rng: np.random.Generator, vehicle: bool) -> Image:
    """Draw noise with horizontal dark bars for a vehicle, vertical ones for anything else."""
    image = rng.integers(120, 200, (SIZE, SIZE, 3), dtype=np.uint8)
    at = int(rng.integers(2, 6))
    bars = image if vehicle else image.swapaxes(0, 1)
    bars[at : at + 3] = bars[at + 6 : at + 9] = 30
    return image


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    rng = np.random.default_rng(0)
    for group, count in GROUPS.items():
        (folder / group).mkdir(parents=True)
        for i in range(count):
            write_image(folder / group / f"{i}.png", texture(rng, group.startswith("vehicles")))
    return folder


@pytest.fixture(scope="module")
def mined(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the same set with boxes: the bars of `vehicles/near`, and more in `boxes/`."""
    folder = tmp_path_factory.mktemp("mined") / "set"
    shutil.copytree(data, folder)
    rng = np.random.default_rng(1)
    (folder / "boxes" / "near").mkdir(parents=True)
    rows = ["name,left,top,right,bottom"]
    for name in [f"boxes/near/{i}.png" for i in range(40)]:
        top = int(rng.integers(0, 8))
        image = rng.integers(120, 200, (SIZE, SIZE, 3), dtype=np.uint8)
        image[top : top + 8] = 30
        write_image(folder / name, image)
        rows.append(f"{name},,{top / SIZE - 0.5},,{(top + 8) / SIZE - 0.5}")
    rows += [f"vehicles/near/{i}.png,-0.5,,0.5," for i in range(GROUPS["vehicles/near"])]
    (folder / "boxes.csv").write_text("\n".join(rows) + "\n")
    return folder


@pytest.fixture
def files(data: Path) -> list[PatchFile]:
    return find_patches([data])


def described(files: list[PatchFile], *, augmented: bool = False, jobs: int = 1) -> LabelledVectors:
    return extract(files, SETTINGS.svm.features, augmented=augmented, jobs=jobs)


def test_several_threads_give_the_same_as_one(files: list[PatchFile]) -> None:
    one, three = (described(files, augmented=True, jobs=jobs) for jobs in (1, 3))
    for name in ("vectors", "vehicle", "sides", "origins"):
        np.testing.assert_array_equal(getattr(one, name), getattr(three, name))
    np.testing.assert_array_equal(one.groups, three.groups)


def test_broken_patches_are_an_error_that_names_the_first(
    files: list[PatchFile], tmp_path: Path
) -> None:
    (tmp_path / "vehicles").mkdir()
    broken = [PatchFile(tmp_path, f"vehicles/{i}.png", "vehicles/far", True) for i in range(3)]
    for file in broken:
        (tmp_path / file.name).write_text("no picture")
    with pytest.raises(DataError, match=r"vehicles/0\.png: is not a readable image$"):
        train([*files[:9], *broken, *files[9:]], SETTINGS, jobs=1)


TAILS = np.array(["a"] * 10 + ["b"] * 5 + ["c"] * 3 + ["d"])


def test_the_last_of_each_group_are_held_out() -> None:
    assert np.flatnonzero(hold_out(TAILS)).tolist() == [8, 9, 14, 17]
    scattered = hold_out(np.array(["a", "b"] * 5))
    assert np.flatnonzero(scattered).tolist() == [8, 9]


def test_neither_test_patches_nor_samples_made_of_them_are_learned_from(
    mined: Path, tmp_path: Path
) -> None:
    """Other pictures in place of the held-out ones give the same model."""
    files = find_patches([mined])
    spoilt = tmp_path / "spoilt"
    shutil.copytree(mined, spoilt)
    for is_boxed in (False, True):
        some = [file for file in files if file.is_boxed is is_boxed]
        groups = np.array([file.group for file in some])
        held = hold_out(groups)
        for row in np.flatnonzero(held):
            flat = np.full((SIZE, SIZE, 3), row, np.uint8)
            write_image(spoilt / some[row].name, flat)
    one, _ = train(files, SETTINGS, jobs=1)
    other, report = train(find_patches([spoilt]), SETTINGS, jobs=1)
    np.testing.assert_array_equal(one.weights, other.weights)
    np.testing.assert_array_equal(one.slopes, other.slopes)
    assert one.box_regression is not None
    assert other.box_regression is not None
    np.testing.assert_array_equal(one.box_regression.weights, other.box_regression.weights)
    learnt = sum(report.groups.values()) - report.groups["boxes/near"] - report.test.patches
    assert report.samples > 2 * learnt


def test_a_trained_model_has_its_provenance_and_can_be_saved(
    files: list[PatchFile], tmp_path: Path
) -> None:
    model, report = train(files, SETTINGS, jobs=1)
    save_model(model, tmp_path / "model.npz")
    loaded = load_model(tmp_path / "model.npz", SETTINGS.svm.features)
    provenance = loaded.provenance
    assert provenance["program"] == f"vdet {vdet.__version__}"
    assert provenance["training"] == SETTINGS.train.svm.model_dump(mode="json")
    assert provenance["report"] == json.loads(json.dumps(asdict(report)))
    np.testing.assert_array_equal(loaded.weights, model.weights)


def test_with_boxes_a_model_finds_the_sides_of_vehicles(
    mined: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vdet.learn.svm.training.PENALTY", 1e-3)  # the patches are few
    files = find_patches([mined])
    model, report = train(files, SETTINGS, jobs=1)
    assert model.box_regression is not None
    last = [file for file in files if file.is_boxed][-1]
    assert last.sides is not None
    features = SETTINGS.svm.features
    vector = describe(split(read_image(mined / last.name), features), features)
    hogs = vector[: features.hog_length]
    found = model.box_regression.sides(hogs[np.newaxis])[0]
    np.testing.assert_allclose(found[[1, 3]], np.array(last.sides, float)[[1, 3]], atol=0.1)
    np.testing.assert_allclose(found[[0, 2]], [-0.5, 0.5], atol=0.05)
    error = report.box_error
    assert error is not None
    assert error < 0.06
    assert report.groups == GROUPS | {"boxes/near": 40}
    assert "boxes/near" not in report.test.groups, "they belong to neither class"


def test_a_new_model_is_tested_on_the_last_patches_of_each_folder(
    data: Path, tmp_path: Path
) -> None:
    copy = shutil.copytree(data, tmp_path / "copy")
    shutil.copy(copy / "vehicles/far/0.png", copy / "non-vehicles/sky/9.png")
    steps: list[tuple[str, int | None]] = []

    def start(what: str, total: int | None) -> Callable[[int], object]:
        steps.append((what, total))
        return lambda _: None

    found = train(find_patches([copy]), SETTINGS, progress=start)[1].test
    assert (found.patches, found.accuracy) == (2 + 4 + 3 + 2, 10 / 11)
    assert found.groups["non-vehicles/sky"] == 0.5
    assert steps[:2] == [("describing patches", 57), ("fitting the classifier", None)]


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
    assert model.features == FEATURES


@pytest.mark.parametrize(("vehicles", "others"), [(2, 30), (30, 0)])
def test_too_few_patches_of_a_class_for_the_folds_are_an_error(vehicles: int, others: int) -> None:
    vehicle = np.array([True] * vehicles + [False] * others, bool)
    vectors = np.ones((len(vehicle), 24), np.float32)
    message = rf"a class has {min(vehicles, others)} training patches, must be at least 3; add more"
    with pytest.raises(DataError, match=message):
        fit(vectors, vehicle)


def test_an_svm_that_has_not_converged_is_reported_by_a_warning(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    fit(*clouds())
    assert caplog.messages == []
    monkeypatch.setattr("vdet.learn.svm.training.MAX_ITERATIONS", 1)
    fit(*clouds(), penalty=1e6)
    assert "the SVM has not converged; lower train.svm.C" in caplog.text


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


def test_a_fit_has_the_training_part_in_memory_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vdet.learn.svm.training.MAX_ITERATIONS", 5)
    rng = np.random.default_rng(0)
    origins = np.concatenate([np.arange(3000), rng.integers(0, 3000, 4500)])
    vectors = rng.normal(size=(7500, 768)).astype(np.float32)
    vehicle = (vectors[:, 0] > 0)[origins]
    rows = labelled(vectors, vehicle, origins)
    tracemalloc.start()
    fit_rows(rows.of(np.ones(3000, bool)), Settings(detector=SvmSettings()))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1.5 * vectors.nbytes


TRUE = BoxRegression(
    np.random.default_rng(1).normal(size=(4, 12)).astype(np.float32),
    np.array([-0.5, -0.4, 0.5, 0.3], np.float32),
)


def scene(count: int = 400) -> tuple[Float32Array, Float32Array]:
    """Return features of different spread, and the sides that `TRUE` computes from them."""
    rng = np.random.default_rng(0)
    hogs = (rng.random((count, 12)) * np.linspace(0.05, 1, 12)).astype(np.float32)
    return hogs, TRUE.sides(hogs)


def fit_columns(hogs: Float32Array, sides: Float32Array, penalty: float) -> BoxRegression:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("vdet.learn.svm.training.PENALTY", penalty)
        return fit_sides(hogs.copy(), sides)


def test_the_rows_in_which_a_side_is_unknown_do_not_count_for_it() -> None:
    hogs, sides = scene()
    sides[100:200, 0] = sides[:30, 2] = sides[50:80, 3] = np.nan
    sides[:, 1] = np.nan
    found = fit_columns(hogs, sides, penalty=1e-6)
    for side in (0, 2, 3):
        np.testing.assert_allclose(found.weights[side], TRUE.weights[side], atol=0.01)
    assert found.sides(hogs)[:, 1].tolist() == [0] * 400


@pytest.mark.parametrize("count", [400, 8])
def test_the_penalty_is_per_patch_so_that_a_set_given_twice_gives_the_same(count: int) -> None:
    """A set of 8 patches has fewer rows than features; given twice, it has more."""
    hogs, sides = scene(count)
    once = fit_columns(hogs, sides, penalty=0.5)
    twice = fit_columns(np.tile(hogs, (2, 1)), np.tile(sides, (2, 1)), penalty=0.5)
    np.testing.assert_allclose(once.weights, twice.weights, atol=1e-4)


def test_a_feature_that_hardly_varies_gets_a_small_weight() -> None:
    hogs, sides = scene()
    hogs[:, 0] = 1 + 1e-4 * np.random.default_rng(4).normal(size=len(hogs))
    assert abs(fit_columns(hogs, sides, penalty=0.1).weights[:, 0]).max() < 0.1


def test_patches_are_compared_by_class_and_by_group() -> None:
    assert Classification.of(
        np.array([True, True, True, False, False]),
        np.array([True, True, False, True, False]),
        np.array(["a", "a", "b", "c", "c"]),
    ) == Classification(5, 0.6, 2 / 3, 2 / 3, [[2, 1], [1, 1]], {"a": 1.0, "b": 0.0, "c": 0.5})
    none = np.zeros(2, bool)
    without = Classification.of(none, none, np.array(["a", "a"]))
    assert (without.accuracy, without.precision, without.recall) == (1, None, None)

import json
import shutil
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

import vdet
from vdet.boxes import Image
from vdet.config.kinds import FeatureSettings, HistogramSettings, HogSettings
from vdet.config.schema import Settings, SvmSettings, SvmTrainingSettings, TrainSettings
from vdet.detect.svm.model import FeatureExtractor, load_model, save_model
from vdet.errors import DataError
from vdet.learn.svm.patches import LabelledVectors, PatchFile, extract, find_patches, hold_out
from vdet.learn.svm.training import train
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


def describe(files: list[PatchFile], *, augmented: bool = False, jobs: int = 1) -> LabelledVectors:
    return extract(files, SETTINGS.svm.features, augmented=augmented, jobs=jobs)


def test_several_threads_give_the_same_as_one(files: list[PatchFile]) -> None:
    one, three = (describe(files, augmented=True, jobs=jobs) for jobs in (1, 3))
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
    described = FeatureExtractor(SETTINGS.svm.features).describe(read_image(mined / last.name))
    hogs = described[: SETTINGS.svm.features.hog_length]
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

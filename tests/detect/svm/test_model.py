import io
import json
import math
import pickle
import tracemalloc
import zipfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from vdet.config.detector import FeatureSettings, HistogramSettings, HogSettings
from vdet.detect.svm.model import BoxRegression, LinearModel, load_model, save_model
from vdet.errors import ModelError

# 4 × 4 cells, each a block of its own, 2 directions: 96 features, and 24 of the histogram
SMALL = FeatureSettings(
    patch=16,
    hog=HogSettings(cell=4, block=1, orientations=2),
    histogram=HistogramSettings(bins=8),
)


def model_of(members: int, features: FeatureSettings = SMALL) -> LinearModel:
    rng = np.random.default_rng(members)
    weights = rng.normal(size=(members, features.length)).astype(np.float32)
    biases, slopes, offsets = rng.normal(size=(3, members)).astype(np.float32)
    provenance = {"data": "drawn", "accuracy": 0.5}
    return LinearModel(features, weights, biases, slopes, offsets, provenance)


def model_with_boxes() -> LinearModel:
    rng = np.random.default_rng(9)
    weights, biases = rng.normal(size=(4, 96)), rng.normal(size=4)
    boxes = BoxRegression(weights.astype(np.float32), biases.astype(np.float32))
    return replace(model_of(2), box_regression=boxes)


def boxes_of(model: LinearModel) -> BoxRegression:
    assert model.box_regression is not None
    return model.box_regression


def header_of(asked: FeatureSettings = SMALL, **changes: Any) -> dict[str, Any]:
    header = {
        "format": "vdet model",
        "version": 2,
        "features": asked.model_dump(mode="json"),
        "provenance": {},
    }
    return {key: value for key, value in (header | changes).items() if value is not ...}


def arrays_of(model: LinearModel) -> dict[str, npt.NDArray[Any]]:
    return {name: getattr(model, name) for name in ("weights", "biases", "slopes", "offsets")}


def write_npz(path: Path, header: object, **arrays: npt.NDArray[Any]) -> Path:
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    parts: dict[str, Any] = arrays_of(model_of(2)) | arrays
    np.savez_compressed(path, header=np.frombuffer(text, np.uint8), **parts)
    return path


def box_arrays() -> dict[str, npt.NDArray[Any]]:
    boxes = boxes_of(model_with_boxes())
    return {"box_weights": boxes.weights, "box_biases": boxes.biases}


def write_with_boxes(path: Path, **changes: npt.NDArray[Any]) -> Path:
    return write_npz(path, header_of(), **box_arrays() | changes)


def write_members(path: Path, members: Mapping[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(f"{name}.npy", data)
    return path


def npy(array: npt.NDArray[Any]) -> bytes:
    file = io.BytesIO()
    np.save(file, array, allow_pickle=True)
    return file.getvalue()


def npy_header(kind: str, shape: str) -> bytes:
    text = f"{{'descr': {kind!r}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


def members_of(model: LinearModel, **changes: bytes) -> dict[str, bytes]:
    header = np.frombuffer(json.dumps(header_of()).encode(), np.uint8)
    return {k: npy(v) for k, v in {"header": header, **arrays_of(model)}.items()} | changes


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "model.npz"


def test_the_probability_is_the_mean_of_the_members_sigmoids() -> None:
    model = LinearModel(
        SMALL,
        np.array([[1.0], [2.0]], np.float32),
        np.array([0.5, -1.0], np.float32),
        np.array([-1.5, -0.5], np.float32),
        np.array([0.25, 0.0], np.float32),
    )
    first = 1 / (1 + math.exp(-1.5 * (1.0 * 2 + 0.5) + 0.25))
    second = 1 / (1 + math.exp(-0.5 * (2.0 * 2 - 1.0) + 0.0))
    probability = model.probabilities(np.array([[2.0]], np.float32))
    assert probability.dtype == np.float32
    assert probability.tolist() == [pytest.approx((first + second) / 2, abs=1e-6)]


def test_huge_decision_values_give_probabilities_of_0_and_1_without_overflow() -> None:
    one = np.ones(1, np.float32)
    model = LinearModel(SMALL, np.array([[1e30]], np.float32), 0 * one, -one, 0 * one)
    probabilities = model.probabilities(np.array([[-1.0], [0.0], [1.0]], np.float32))
    assert probabilities.tolist() == pytest.approx([0, 0.5, 1])


@pytest.mark.parametrize("members", [1, 3, 20])
def test_a_saved_model_is_loaded_bit_for_bit(path: Path, members: int) -> None:
    model = model_of(members)
    save_model(model, path)
    loaded = load_model(path)
    assert loaded.features == model.features
    assert loaded.provenance == model.provenance
    for name, array in arrays_of(model).items():
        np.testing.assert_array_equal(getattr(loaded, name), array)
        assert getattr(loaded, name).dtype == np.float32


def test_a_model_that_does_not_say_which_channels_are_halved_has_none(path: Path) -> None:
    features = SMALL.model_copy(update={"halved": ()})
    header = header_of(features)
    del header["features"]["halved"]
    header["features"]["color_space"] = "YCrCb"  # as older versions wrote it
    header["features"]["spatial"] = {"size": 0}
    header["features"]["hog"]["channels"] = [0, 1, 2]
    write_npz(path, header)
    assert load_model(path).features == features


def test_the_sides_of_a_box_are_linear_in_the_hog() -> None:
    weights = np.array([[1, 0], [0, 1], [2, 0], [0, -1]], np.float32)
    regression = BoxRegression(weights, np.array([-0.5, -0.5, 0.5, 0.5], np.float32))
    sides = regression.sides(np.array([[0.25, 1], [0, 0]], np.float32))
    assert sides.tolist() == [[-0.25, 0.5, 1, -0.5], [-0.5, -0.5, 0.5, 0.5]]


def test_the_regression_of_boxes_is_kept_bit_for_bit(path: Path) -> None:
    saved = model_with_boxes()
    save_model(saved, path)
    loaded = load_model(path, SMALL)
    np.testing.assert_array_equal(loaded.weights, saved.weights)
    for name in ("weights", "biases"):
        array = getattr(boxes_of(loaded), name)
        np.testing.assert_array_equal(array, getattr(boxes_of(saved), name))
        assert array.dtype == np.float32


@pytest.mark.parametrize("missing", ["box_weights", "box_biases"])
def test_a_regression_with_one_of_its_two_arrays_is_damaged(path: Path, missing: str) -> None:
    arrays = {name: array for name, array in box_arrays().items() if name != missing}
    with pytest.raises(ModelError, match="damaged"):
        load_model(write_npz(path, header_of(), **arrays))


def test_a_model_asked_for_other_features_says_which_it_has(path: Path) -> None:
    save_model(model_of(1), path)
    asked = SMALL.model_copy(update={"patch": 32})
    message = r'trained with other features: detector\.features=\{"patch":16,'
    with pytest.raises(ModelError, match=message):
        load_model(path, asked)


@pytest.mark.parametrize("data", [b"", b"not a zip file", b"PK\x05\x06" + bytes(18)])
def test_a_file_that_is_not_a_zip_file_is_no_model(path: Path, data: bytes) -> None:
    path.write_bytes(data)
    with pytest.raises(ModelError, match="is not a vdet model, or is damaged; train one"):
        load_model(path)


def test_a_model_cut_off_anywhere_is_damaged(path: Path) -> None:
    save_model(model_of(3), path)
    whole = path.read_bytes()
    for length in range(0, len(whole), 37):
        path.write_bytes(whole[:length])
        with pytest.raises(ModelError, match="damaged"):
            load_model(path)


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (header_of(format="something else"), "is not a vdet model"),
        (b"{not json", "is not a vdet model"),
        (b"\xff\xfe\xff", "is not a vdet model"),
        (b"[" * 100_000, "is not a vdet model"),
        (header_of(version=1), r"of version 1, not 2; train it again"),
        (header_of(version=[1]), r"of version \[1\]"),
        (header_of(features={"patch": 63}), "is not a vdet model, or is damaged"),
        (header_of(features={"colour": "red"}), "is not a vdet model, or is damaged"),
        (
            header_of(features=SMALL.model_dump(mode="json") | {"color_space": "HSV"}),
            "its colour space is not YCrCb",
        ),
        (header_of(provenance=[]), "is not a vdet model, or is damaged"),
    ],
)
def test_a_header_that_is_not_understood_is_refused(
    path: Path, header: object, message: str
) -> None:
    with pytest.raises(ModelError, match=message):
        load_model(write_npz(path, header))


@pytest.mark.parametrize("missing", ["header", "weights", "biases", "slopes", "offsets"])
def test_a_model_without_one_of_its_parts_is_damaged(path: Path, missing: str) -> None:
    members = members_of(model_of(2))
    del members[missing]
    with pytest.raises(ModelError, match="damaged"):
        load_model(write_members(path, members))


@pytest.mark.parametrize(
    ("name", "array", "message"),
    [
        ("weights", np.zeros((2, 119), np.float32), r"or not of shape \(2, 120\)"),
        ("weights", np.zeros((2, 120)), "weights are damaged"),
        ("weights", np.full((2, 120), np.nan, np.float32), "weights are damaged"),
        ("biases", np.zeros((2, 1), np.float32), "biases are damaged"),
        ("biases", np.array([0, np.inf], np.float32), "biases are damaged"),
        ("biases", np.zeros(2, "S4"), "biases are damaged"),
        ("box_weights", np.zeros((4, 95), np.float32), r"or not of shape \(4, 96\); train it"),
        ("box_biases", np.array([0, 0, np.inf, 0], np.float32), "box_biases are damaged"),
        ("slopes", np.zeros(2, ">f4"), "slopes are damaged"),
        ("slopes", np.array([np.nan, 0], np.float32), "slopes are damaged"),
        ("offsets", np.float32(0), "offsets are damaged"),
        ("offsets", np.array([-np.inf, 0], np.float32), "offsets are damaged"),
    ],
)
def test_an_array_that_does_not_fit_is_refused(
    path: Path, name: str, array: npt.NDArray[Any], message: str
) -> None:
    with pytest.raises(ModelError, match=message):
        load_model(write_with_boxes(path, **{name: array}))


def test_a_model_without_members_is_refused(path: Path) -> None:
    arrays = {name: np.zeros(0, np.float32) for name in ("biases", "slopes", "offsets")}
    weights = np.zeros((0, 120), np.float32)
    with pytest.raises(ModelError, match="has no SVM; train it again"):
        load_model(write_npz(path, header_of(), weights=weights, **arrays))


class _Trap:
    """Makes a folder when it is unpickled."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.mkdir, (self.folder,)


def test_pickled_objects_are_refused_and_not_run(path: Path, tmp_path: Path) -> None:
    trap = np.array([_Trap(tmp_path / "sprung")], object)
    for name in ("header", "weights"):
        with pytest.raises(ModelError, match="damaged"):
            load_model(write_members(path, members_of(model_of(2), **{name: npy(trap)})))
    path.write_bytes(pickle.dumps(trap))
    with pytest.raises(ModelError):
        load_model(path)
    assert not (tmp_path / "sprung").exists()


def test_no_memory_is_allocated_for_a_shape_that_the_file_does_not_hold(path: Path) -> None:
    data = npy_header("<f4", "(1000000000,)") + bytes(192)
    write_members(path, members_of(model_of(2), weights=data))
    tracemalloc.start()
    with pytest.raises(ModelError, match="damaged"):
        load_model(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 10_000_000

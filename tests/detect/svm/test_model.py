"""Features of patches, and the model over them in its file."""

import json
import math
import pickle
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from seed import SEED
from vdet.config.kinds import FeatureSettings, HistogramSettings, HogSettings
from vdet.detect.svm.model import (
    BoxRegression,
    LinearModel,
    cut_window,
    describe,
    halve,
    histogram,
    load_model,
    resize,
    save_model,
    split,
)
from vdet.errors import ModelError

# 4 × 4 cells, each a block of its own, 2 directions: 96 features, and 24 of the histogram
SMALL = FeatureSettings(
    patch=16, hog=HogSettings(cell=4, block=1, orientations=2), histogram=HistogramSettings(bins=8)
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


def header_of(**changes: Any) -> dict[str, Any]:
    features = SMALL.model_dump(mode="json")
    header = {"format": "vdet model", "version": 2, "features": features, "provenance": {}}
    return header | changes


def arrays_of(model: LinearModel) -> dict[str, npt.NDArray[Any]]:
    arrays = {name: getattr(model, name) for name in ("weights", "biases", "slopes", "offsets")}
    if boxes := model.box_regression:
        arrays |= {"box_weights": boxes.weights, "box_biases": boxes.biases}
    return arrays


def write_parts(path: Path, **changes: Any) -> Path:
    """Write a model of two members with boxes, with some parts replaced; None leaves one out."""
    parts: dict[str, Any] = {"header": header_of(), **arrays_of(model_with_boxes())} | changes
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, part in parts.items():
            if part is None:
                continue
            text = json.dumps(part).encode() if isinstance(part, dict) else part
            array = np.frombuffer(text, np.uint8) if isinstance(text, bytes) else text
            with archive.open(f"{name}.npy", "w") as file:
                np.save(file, array, allow_pickle=True)
    return path


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


@pytest.mark.parametrize("model", [model_of(1), model_of(20), model_with_boxes()])
def test_a_saved_model_is_loaded_bit_for_bit(path: Path, model: LinearModel) -> None:
    save_model(model, path)
    loaded = load_model(path)
    assert (loaded.features, loaded.provenance) == (model.features, model.provenance)
    arrays = arrays_of(loaded)
    assert arrays.keys() == arrays_of(model).keys()
    for name, array in arrays_of(model).items():
        np.testing.assert_array_equal(arrays[name], array)
        assert arrays[name].dtype == np.float32


def test_the_sides_of_a_box_are_linear_in_the_hog() -> None:
    weights = np.array([[1, 0], [0, 1], [2, 0], [0, -1]], np.float32)
    regression = BoxRegression(weights, np.array([-0.5, -0.5, 0.5, 0.5], np.float32))
    sides = regression.sides(np.array([[0.25, 1], [0, 0]], np.float32))
    assert sides.tolist() == [[-0.25, 0.5, 1, -0.5], [-0.5, -0.5, 0.5, 0.5]]


EMPTY = np.zeros(0, np.float32)
DAMAGED = "is not a vdet model, or is damaged; train one"
WRONG: list[tuple[dict[str, Any], str]] = [
    ({"header": header_of(format="something else")}, "is not a vdet model"),
    ({"header": b"{not json"}, "is not a vdet model"),
    ({"header": header_of(version=1)}, r"of version 1, not 2; train it again"),
    ({"header": header_of(version=[1])}, r"of version \[1\]"),
    ({"header": header_of(features={"patch": 63})}, DAMAGED),
    ({"header": header_of(features={"colour": "red"})}, DAMAGED),
    ({"header": header_of(provenance=[])}, DAMAGED),
    *(({name: None}, "damaged") for name in ("header", *arrays_of(model_with_boxes()))),
    ({"weights": np.zeros((2, 119), np.float32)}, r"or not of shape \(2, 120\)"),
    ({"weights": np.zeros((2, 120))}, "weights are damaged"),
    ({"weights": np.full((2, 120), np.nan, np.float32)}, "weights are damaged"),
    ({"biases": np.zeros((2, 1), np.float32)}, "biases are damaged"),
    ({"biases": np.array([0, np.inf], np.float32)}, "biases are damaged"),
    ({"biases": np.zeros(2, "S4")}, "biases are damaged"),
    ({"box_weights": np.zeros((4, 95), np.float32)}, r"or not of shape \(4, 96\); train it"),
    ({"box_biases": np.array([0, 0, np.inf, 0], np.float32)}, "box_biases are damaged"),
    (
        {"weights": np.zeros((0, 120), np.float32)}
        | dict.fromkeys(("biases", "slopes", "offsets"), EMPTY),
        "has no SVM; train it again",
    ),
]


@pytest.mark.parametrize(("parts", "message"), WRONG)
def test_a_model_with_a_part_that_is_wrong_or_missing_is_refused(
    path: Path, parts: dict[str, Any], message: str
) -> None:
    with pytest.raises(ModelError, match=message):
        load_model(write_parts(path, **parts))


@pytest.mark.parametrize("data", [b"", b"not a zip file", b"PK\x05\x06" + bytes(18)])
def test_a_file_that_is_not_a_zip_file_is_no_model(path: Path, data: bytes) -> None:
    path.write_bytes(data)
    with pytest.raises(ModelError, match=DAMAGED):
        load_model(path)


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
            load_model(write_parts(path, **{name: trap}))
    path.write_bytes(pickle.dumps(trap))
    with pytest.raises(ModelError):
        load_model(path)
    assert not (tmp_path / "sprung").exists()


PATCH = np.random.default_rng(0).integers(0, 256, (64, 64, 3), dtype=np.uint8)
FEATURES = SEED.svm.features


def test_a_vector_of_the_seed_is_the_hog_of_opencv_and_the_histogram_of_numpy() -> None:
    descriptor = cv2.HOGDescriptor((64, 64), (16, 16), (8, 8), (8, 8), 8)
    channels = cv2.split(cv2.cvtColor(PATCH, cv2.COLOR_BGR2YCrCb))
    hogs = [np.ravel(descriptor.compute(channel)) for channel in channels]
    counts = [np.histogram(channel, 32, range=(0, 256))[0] for channel in channels]
    vector = describe(split(PATCH, FEATURES), FEATURES)
    assert (FEATURES.hog_length, FEATURES.length) == (3 * 1568, 4800)
    assert vector.dtype == np.float32
    np.testing.assert_array_equal(vector, np.concatenate([*hogs, *counts]))


def test_a_halved_channel_is_described_at_half_its_size() -> None:
    features = FEATURES.model_copy(update={"halved": (1, 2)})
    _, red, blue = split(PATCH, FEATURES)
    descriptor = cv2.HOGDescriptor((32, 32), (8, 8), (4, 4), (4, 4), 8)
    hogs = [np.ravel(descriptor.compute(halve(channel))) for channel in (red, blue)]
    counts = [histogram(halve(channel), 32) for channel in (red, blue)]
    whole, vector = (describe(split(PATCH, item), item) for item in (FEATURES, features))
    np.testing.assert_array_equal(vector[:1568], whole[:1568])
    np.testing.assert_array_equal(vector[1568:4704], np.concatenate(hogs))
    np.testing.assert_array_equal(vector[4704:], [*whole[4704:4736], *np.concatenate(counts)])


def test_a_crop_twice_too_large_is_halved_each_pixel_the_mean_of_four() -> None:
    means = PATCH.reshape(32, 2, 32, 2, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(halve(PATCH), means, atol=0.5)
    np.testing.assert_array_equal(resize(PATCH, 32, 32), halve(PATCH))
    np.testing.assert_array_equal(resize(PATCH, 16, 16), halve(halve(PATCH)))


def test_every_pixel_counts_however_small_the_patch() -> None:
    for size in (64, 60, 50, 37):
        crop = np.zeros((size, size, 3), np.uint8)
        crop[:, ::2] = 200  # on average, stripes of one pixel are an even grey
        assert np.abs(resize(crop, 8, 8).astype(int) - 100).max() <= 20


PIXELS = st.integers(1, 40)


BEYOND = 50
PADDED = np.pad(PATCH, ((BEYOND, BEYOND), (BEYOND, BEYOND), (0, 0)), mode="edge")
CORNERS = st.integers(-BEYOND, 64 + BEYOND - 40)


@example(x=-10, y=20, width=30, height=20)
@example(x=50, y=20, width=30, height=20)
@example(x=20, y=-10, width=20, height=30)
@example(x=20, y=50, width=20, height=30)
@example(x=-BEYOND, y=20, width=40, height=20)
@given(CORNERS, CORNERS, PIXELS, PIXELS)
def test_beyond_each_side_of_an_image_the_outermost_pixels_repeat(
    x: int, y: int, width: int, height: int
) -> None:
    left, top = x + BEYOND, y + BEYOND
    window = cut_window(PATCH, x, y, width, height)
    np.testing.assert_array_equal(window, PADDED[top : top + height, left : left + width])

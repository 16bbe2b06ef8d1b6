"""The linear model: weights, probabilities, and the file that holds them.

A model is one or several linear SVMs, its members. Each has a sigmoid that turns its decision value
into a probability (Platt 1999); the model's probability is the mean over the members. Features are
not scaled before: their scaling is part of the weights.
"""

import io
import json
import warnings
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vdet.archives import open_archive, read_member
from vdet.boxes import Float32Array
from vdet.config.svm import FeatureSettings
from vdet.errors import ModelError
from vdet.files import read_whole, staged

FORMAT, FORMAT_VERSION = "vdet model", 2
MAX_MEMBERS = 20
MAX_VALUE = 1e9
"""Largest absolute value of any number in a model; with larger ones, sigmoids could overflow."""
_MAX_BYTES = 64_000_000
_ARRAYS = ("weights", "biases", "slopes", "offsets")
_BOX_ARRAYS = ("box_weights", "box_biases")


@dataclass(frozen=True, slots=True)
class BoxRegression:
    """Finds the sides of the vehicle in a window, as linear functions of the window's HOG.

    `weights` is float32 `(4, h)`, `h` the number of HOG features of a patch; `biases` is float32
    `(4,)`. The rows give left, top, right and bottom, measured from the centre of the window in its
    sides. Source: the bounding-box regression of Felzenszwalb et al., "Object Detection with
    Discriminatively Trained Part-Based Models", 2010, section 7.
    """

    weights: Float32Array
    biases: Float32Array

    def sides(self, hogs: Float32Array) -> Float32Array:
        """Return left, top, right, bottom for HOG vectors, `(m, h)` → `(m, 4)`."""
        return hogs @ self.weights.T + self.biases


@dataclass(frozen=True, slots=True)
class LinearModel:
    """`k` calibrated linear SVMs over `n` features.

    The decision value of member i for the features x is `weights[i] · x + biases[i]`; its
    probability is `1 / (1 + exp(slopes[i] · value + offsets[i]))`.

    Attributes
    ----------
    features
        What the features are.
    weights
        float32 `(k, n)`.
    biases, slopes, offsets
        float32 `(k,)`.
    provenance
        Where the model comes from: data set, metrics, versions; JSON values.
    box_regression
        None where no training patch came with the box of its vehicle.
    """

    features: FeatureSettings
    weights: Float32Array
    biases: Float32Array
    slopes: Float32Array
    offsets: Float32Array
    provenance: dict[str, Any] = field(default_factory=dict)
    box_regression: BoxRegression | None = None

    def probabilities(self, vectors: Float32Array) -> Float32Array:
        """Return the probability that each vector is of a vehicle, `(m, n)` → `(m,)`."""
        return self.to_probabilities(vectors @ self.weights.T + self.biases)

    def to_probabilities(self, values: Float32Array) -> Float32Array:
        """Return the mean probability over the members for decision values, `(m, k)` → `(m,)`."""
        exponent = np.clip(values * self.slopes + self.offsets, -80, 80)
        return np.asarray((1 / (1 + np.exp(exponent))).mean(axis=1), np.float32)


def save_model(model: LinearModel, path: Path, *, overwrite: bool = False) -> None:
    """Write a model as `.npz` without pickle: arrays and a JSON header. Raises `OutputError`."""
    header = {
        "format": FORMAT,
        "version": FORMAT_VERSION,
        "features": model.features.model_dump(mode="json"),
        "provenance": model.provenance,
    }
    arrays = {name: getattr(model, name) for name in _ARRAYS}
    if model.box_regression is not None:
        parts = model.box_regression.weights, model.box_regression.biases
        arrays |= zip(_BOX_ARRAYS, parts, strict=True)
    text = np.frombuffer(json.dumps(header).encode(), np.uint8)
    with staged(path, overwrite=overwrite) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, header=text, **arrays)


def load_model(path: Path, features: FeatureSettings | None = None) -> LinearModel:
    """Read a model; with `features`, check that it was trained with these.

    The file is data: nothing in it is executed.

    Raises
    ------
    ModelError
        The file cannot be read or is damaged; it is of another version or was trained with other
        features; its arrays do not fit its features; a value is not finite, or larger than
        `MAX_VALUE`.
    """
    data = read_whole(path, most=_MAX_BYTES, what="model", error=ModelError)
    try:
        with open_archive(io.BytesIO(data)) as archive, warnings.catch_warnings(action="error"):
            model = _read(archive)
    except ModelError as error:
        raise ModelError(f"{path}: {error}; train it again") from error
    except Exception as error:  # NumPy, json and pydantic raise a dozen kinds on damaged data
        raise ModelError(f"{path}: is not a vdet model, or is damaged; train one") from error
    if features is not None and features != model.features:
        raise ModelError(
            f"{path}: was trained with other features: {_difference(model.features, features)}"
        )
    return model


def _read(archive: zipfile.ZipFile) -> LinearModel:
    header = json.loads(_read_array(archive, "header").tobytes())
    if header["format"] != FORMAT or not isinstance(header["provenance"], dict):
        raise ValueError("not the header of a model")
    if header["version"] != FORMAT_VERSION:
        raise ModelError(f"is of version {header['version']!r:.20}, not {FORMAT_VERSION}")
    # The shipped models name the size of small pictures, which are features no more, and the
    # channels that have HOG. That of the original does not say which channels are halved: none is.
    known = {"halved": ()} | header["features"]
    known.pop("spatial", None)
    known["hog"].pop("channels", None)
    boxes = [name for name in _BOX_ARRAYS if f"{name}.npy" in archive.namelist()]
    features, provenance = FeatureSettings.model_validate(known), header["provenance"]
    arrays = {name: _read_array(archive, name) for name in _ARRAYS}
    regression = BoxRegression(*(_read_array(archive, name) for name in boxes)) if boxes else None
    model = LinearModel(features, **arrays, provenance=provenance, box_regression=regression)
    _check_arrays(model)
    return model


def _read_array(archive: zipfile.ZipFile, name: str) -> npt.NDArray[Any]:
    """Return an array of the file; one with another length than it claims is a `ValueError`."""
    data = read_member(archive, f"{name}.npy", most=_MAX_BYTES)
    file = io.BytesIO(data)
    np.lib.format.read_magic(file)
    shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(file)
    values: npt.NDArray[Any] = np.frombuffer(file.read(), dtype)
    return values.reshape(shape, order="F" if is_fortran else "C")


def _check_arrays(model: LinearModel) -> None:
    members = len(model.biases) if model.biases.ndim == 1 else 0
    expected = (members, model.features.length)
    if not 1 <= members <= MAX_MEMBERS or model.weights.shape != expected:
        raise ModelError(f"has weights of shape {model.weights.shape} instead of {expected}")
    for name in _ARRAYS:
        _check_array(getattr(model, name), expected if name == "weights" else (members,), name)
    if model.box_regression is not None:
        _check_array(model.box_regression.weights, (4, model.features.hog_length), _BOX_ARRAYS[0])
        _check_array(model.box_regression.biases, (4,), _BOX_ARRAYS[1])


def _check_array(array: Float32Array, shape: tuple[int, ...], name: str) -> None:
    if array.dtype != np.float32 or array.shape != shape or not (abs(array) <= MAX_VALUE).all():
        raise ModelError(f"its {name} are damaged")


def _difference(trained: FeatureSettings, requested: FeatureSettings) -> str:
    return ", ".join(
        f"detector.features.{name}: {getattr(trained, name)}, asked for {getattr(requested, name)}"
        for name in type(trained).model_fields
        if getattr(trained, name) != getattr(requested, name)
    )

"""The linear model: weights, probabilities, and the file that holds them.

A model is one or several linear SVMs, its members. Each has a sigmoid that turns its decision value
into a probability (Platt 1999); the model's probability is the mean over the members. Features are
not scaled before: their scaling is part of the weights.
"""

import io
import json
import math
import warnings
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import ValidationError

from vdet.archives import open_archive, read_member
from vdet.boxes import Float32Array
from vdet.config.schema import FeatureSettings
from vdet.detect.svm.features import Layout
from vdet.errors import ModelError
from vdet.files import read_whole, staged

FORMAT_VERSION = 2
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
        return self.to_probabilities(self.decision_values(vectors))

    def decision_values(self, vectors: Float32Array) -> Float32Array:
        """Return the decision value of each member for each vector, `(m, n)` → `(m, k)`."""
        return vectors @ self.weights.T + self.biases

    def to_probabilities(self, values: Float32Array) -> Float32Array:
        """Return the mean probability over the members for decision values, `(m, k)` → `(m,)`."""
        exponent = np.clip(values * self.slopes + self.offsets, -80, 80)
        return np.asarray((1 / (1 + np.exp(exponent))).mean(axis=1), np.float32)


def save_model(model: LinearModel, path: Path, *, overwrite: bool = False) -> None:
    """Write a model as `.npz` without pickle: arrays and a JSON header. Raises `OutputError`."""
    header = {
        "format": "vdet model",
        "version": FORMAT_VERSION,
        "features": model.features.model_dump(mode="json"),
        "provenance": model.provenance,
    }
    arrays = {name: getattr(model, name).astype(np.float32) for name in _ARRAYS}
    if model.box_regression is not None:
        parts = (model.box_regression.weights, model.box_regression.biases)
        arrays |= {
            name: part.astype(np.float32) for name, part in zip(_BOX_ARRAYS, parts, strict=True)
        }
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
    header, arrays = _read(path)
    boxes = [arrays.pop(name) for name in _BOX_ARRAYS if name in arrays]
    model = LinearModel(
        _features(header, path),
        **arrays,
        provenance=header.get("provenance", {}),
        box_regression=BoxRegression(*boxes) if boxes else None,
    )
    _check_arrays(model, path)
    if features is not None and features != model.features:
        raise ModelError(
            f"{path}: was trained with other features ({_difference(model.features, features)}); "
            "remove these settings, or train a model with them"
        )
    return model


def _read(path: Path) -> tuple[dict[str, Any], dict[str, Float32Array]]:
    data = read_whole(path, most=_MAX_BYTES, what="model", error=ModelError)
    try:
        with open_archive(io.BytesIO(data)) as archive, warnings.catch_warnings(action="error"):
            unpacked = sum(member.file_size for member in archive.infolist())
            if unpacked > _MAX_BYTES:
                raise ModelError(
                    f"{path}: is far too large for a model: {unpacked:,} bytes when unpacked, "
                    f"at most {_MAX_BYTES:,} are read"
                )
            header = _parse_header(_read_array(archive, "header", path), path)
            with_boxes = any(f"{name}.npy" in archive.namelist() for name in _BOX_ARRAYS)
            names = _ARRAYS + (_BOX_ARRAYS if with_boxes else ())
            arrays = {name: _read_array(archive, name, path) for name in names}
            return header, arrays
    except ModelError:
        raise
    except Exception as error:  # NumPy and json raise a dozen kinds on damaged data
        raise ModelError(
            f"{path}: is not a vdet model, or is damaged; make one with vdet train"
        ) from error


def _read_array(archive: zipfile.ZipFile, name: str, path: Path) -> npt.NDArray[Any]:
    data = read_member(archive, f"{name}.npy", most=_MAX_BYTES)
    _check_declared_size(data, name, path)
    array: npt.NDArray[Any] = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    return array


def _check_declared_size(data: bytes, name: str, path: Path) -> None:
    """Refuse a shape that the file does not hold, before memory is allocated for it."""
    file = io.BytesIO(data)
    version = np.lib.format.read_magic(file)
    if version != (1, 0):
        raise ValueError("not the array format that vdet writes")
    shape, _, dtype = np.lib.format.read_array_header_1_0(file)
    if math.prod(shape) * dtype.itemsize != len(data) - file.tell():
        raise ModelError(
            f"{path}: its part {name} is damaged: the file does not hold the shape {shape!s:.60}; "
            "make a model with vdet train"
        )


def _parse_header(array: npt.NDArray[Any], path: Path) -> dict[str, Any]:
    if array.dtype != np.uint8:
        raise ValueError("the header is not text")
    header = json.loads(array.tobytes())
    if not isinstance(header, dict) or header.get("format") != "vdet model":
        raise ModelError(f"{path}: is not a vdet model; make one with vdet train")
    if header.get("version") != FORMAT_VERSION:
        raise ModelError(
            f"{path}: is a model of version {header.get('version')!r:.20}, this program reads "
            f"version {FORMAT_VERSION}; train it again"
        )
    if not isinstance(header.get("provenance", {}), dict):
        raise ModelError(f"{path}: its provenance is not understood; train it again")
    return header


def _features(header: dict[str, Any], path: Path) -> FeatureSettings:
    try:
        # Older files do not say which channels are halved: none is. They name shrunk patches too.
        known = {"halved": ()} | header["features"]
        known.pop("spatial", None)
        if known.get("histogram") == {"bins": 0}:
            known["histogram"] = {"bins": None}
        return FeatureSettings.model_validate(known)
    except (KeyError, TypeError, ValidationError) as error:
        raise ModelError(
            f"{path}: its feature settings are not understood; train it again"
        ) from error


def _check_arrays(model: LinearModel, path: Path) -> None:
    members = len(model.biases) if model.biases.ndim == 1 else 0
    layout = Layout.of(model.features)
    expected = (members, layout.length)
    if not 1 <= members <= MAX_MEMBERS or model.weights.shape != expected:
        raise ModelError(
            f"{path}: has weights of shape {model.weights.shape}, its features need {expected}; "
            "train it again"
        )
    for name in _ARRAYS[1:]:
        _check_array(getattr(model, name), (members,), name, path)
    _check_array(model.weights, expected, "weights", path)
    if model.box_regression is not None:
        _check_array(model.box_regression.weights, (4, layout.hog_length), _BOX_ARRAYS[0], path)
        _check_array(model.box_regression.biases, (4,), _BOX_ARRAYS[1], path)


def _check_array(array: Float32Array, shape: tuple[int, ...], name: str, path: Path) -> None:
    if array.dtype != np.float32 or array.shape != shape:
        raise ModelError(f"{path}: {name} are damaged; train it again")
    if not np.isfinite(array).all():
        raise ModelError(f"{path}: {name} hold a value that is not a number; train it again")
    if np.abs(array).max() > MAX_VALUE:
        raise ModelError(f"{path}: {name} hold a value beyond {MAX_VALUE:g}; train it again")


def _difference(trained: FeatureSettings, requested: FeatureSettings) -> str:
    return ", ".join(
        f"detector.features.{name}: {getattr(trained, name)}, asked for {getattr(requested, name)}"
        for name in type(trained).model_fields
        if getattr(trained, name) != getattr(requested, name)
    )

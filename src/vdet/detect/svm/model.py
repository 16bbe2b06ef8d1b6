"""The features of a patch, HOG and colour histograms, and the linear model over them with its file.

A model is a linear SVM and a sigmoid that converts its decision value to a probability (Platt
1999). The original has three of them, its members; its probability is the mean over the members.
Features are not scaled: the scaling is part of the weights.

Source of the features: Dalal & Triggs, "Histograms of Oriented Gradients for Human Detection",
2005.
"""

import io
import json
import warnings
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Float32Array, Image
from vdet.config.kinds import FeatureSettings
from vdet.errors import ModelError
from vdet.files import read_whole, staged
from vdet.media.images import to_ycrcb

Channels = tuple[Image, Image, Image]
"""Luma, red and blue (YCrCb), uint8 `(H, W)` each; halved channels `(H / 2, W / 2)`."""

FORMAT, FORMAT_VERSION = "vdet model", 2
MAX_VALUE = 1e9
"""Maximum absolute value of any number in a model; larger ones could overflow sigmoids."""
_MAX_BYTES = 64_000_000
_NAMES = ("weights", "biases", "slopes", "offsets")
_BOX_NAMES = ("box_weights", "box_biases")


def describe(channels: Channels, settings: FeatureSettings) -> Float32Array:
    """Compute the features of one patch from its channels: see `split`.

    They begin with HOG, channel by channel, each as `cv2.HOGDescriptor.compute` gives it (blocks
    column by column from the top, then cells, then orientations). The colour histogram follows,
    channel by channel.

    Returns
    -------
    float32 `(settings.length,)`: HOG 0 to 1, histogram in pixels.
    """
    pairs = zip(hog_descriptors(settings, settings.patch, settings.patch), channels, strict=True)
    hogs = [np.ravel(hog.compute(channel)) for hog, channel in pairs]
    histograms = [histogram(channel, settings.histogram.bins) for channel in channels]
    return np.concatenate([*hogs, *histograms], dtype=np.float32)


def split(image: Image, settings: FeatureSettings) -> Channels:
    """Return the channels of an image, BGR uint8 `(H, W, 3)`."""
    luma, red, blue = (
        halve(channel) if number in settings.halved else channel
        for number, channel in enumerate(to_ycrcb(image))
    )
    return luma, red, blue


def hog_descriptors(settings: FeatureSettings, width: int, height: int) -> list[cv2.HOGDescriptor]:
    """Return OpenCV's descriptor of each channel, with blocks a cell apart.

    Width and height are pixels of the patch; a halved channel has half of them.
    """
    hog, descriptors = settings.hog, []
    for shrink in map(settings.shrink, range(3)):
        side, window = hog.cell // shrink, (width // shrink, height // shrink)
        block, cell = (hog.block * side,) * 2, (side, side)
        descriptors.append(cv2.HOGDescriptor(window, block, cell, cell, hog.orientations))
    return descriptors


def histogram(channel: Image, bins: int) -> npt.NDArray[np.intp]:
    """Count the pixels of one channel in `bins` equal bins over 0 … 255; shape `(bins,)`."""
    return np.bincount(channel.ravel() // (256 // bins), minlength=bins)


def cut_window(image: Image, x: int, y: int, width: int, height: int) -> Image:
    """Return a window of an image; outside the image, the outermost pixels are repeated."""
    rows = np.arange(y, y + height).clip(0, image.shape[0] - 1)
    columns = np.arange(x, x + width).clip(0, image.shape[1] - 1)
    return np.asarray(image[rows[:, np.newaxis], columns])


def resize(image: Image, width: int, height: int) -> Image:
    """Resize an image so that each of its pixels counts.

    It is halved (each pixel the mean of four) while it is at least twice as large and both sides
    are even. Then it is resized bilinearly, or by area if it is still at least twice as large.
    """
    while (
        image.shape[0] >= 2 * height
        and image.shape[1] >= 2 * width
        and image.shape[0] % 2 == image.shape[1] % 2 == 0
    ):
        image = halve(image)
    if image.shape[:2] == (height, width):
        return image
    shrinks = image.shape[0] >= 2 * height or image.shape[1] >= 2 * width
    method = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(image, (width, height), interpolation=method), np.uint8)


def halve(image: Image) -> Image:
    """Return an image of even sides at half its size, each pixel the mean of four."""
    half = (image.shape[1] // 2, image.shape[0] // 2)
    return np.asarray(cv2.resize(image, half, interpolation=cv2.INTER_AREA), np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
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
        Settings of the features.
    weights
        float32 `(k, n)`.
    biases, slopes, offsets
        float32 `(k,)`.
    provenance
        Training data, metrics and versions, as values for JSON.
    box_regression
        None if no training patch had the box of its vehicle.
    """

    features: FeatureSettings
    weights: Float32Array
    biases: Float32Array
    slopes: Float32Array
    offsets: Float32Array
    provenance: dict[str, Any] = field(default_factory=dict)
    box_regression: BoxRegression | None = None

    def probabilities(self, vectors: Float32Array) -> Float32Array:
        """Return the probability of a vehicle for each vector, `(m, n)` → `(m,)`."""
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
    text, arrays = np.frombuffer(json.dumps(header).encode(), np.uint8), _arrays(model)
    with staged(path, overwrite=overwrite) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, header=text, **arrays)


def _arrays(model: LinearModel) -> dict[str, Any]:
    """Return the arrays of a model by their names in the file."""
    arrays = {name: getattr(model, name) for name in _NAMES}
    if boxes := model.box_regression:
        arrays |= {"box_weights": boxes.weights, "box_biases": boxes.biases}
    return arrays


def load_model(path: Path, features: FeatureSettings | None = None) -> LinearModel:
    """Read a model; with `features`, check that it was trained with these.

    The file is data: nothing in it is executed.

    Raises
    ------
    ModelError
        The file cannot be read or is damaged; it has another version or was trained with other
        features; its arrays do not match its features; a value is not finite or exceeds
        `MAX_VALUE`.
    """
    data = read_whole(path, limit=_MAX_BYTES, what="model", error=ModelError)
    try:
        with warnings.catch_warnings(action="error"):
            model = _read(data)
    except ModelError as error:
        raise ModelError(f"{path}: {error}; train it again") from error
    except Exception as error:  # NumPy, json and pydantic raise a dozen kinds on damaged data
        raise ModelError(f"{path}: is not a vdet model, or is damaged; train one") from error
    if features is not None and features != model.features:
        trained = model.features.model_dump_json()
        raise ModelError(f"{path}: was trained with other features: detector.features={trained}")
    return model


def _read(data: bytes) -> LinearModel:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        if sum(member.file_size for member in archive.infolist()) > _MAX_BYTES:
            raise ModelError("is too large")
    with np.load(io.BytesIO(data), allow_pickle=False) as file:
        arrays = {name: file[name] for name in ("header", *_NAMES, *_BOX_NAMES) if name in file}
    header = json.loads(arrays["header"].tobytes())
    if header["format"] != FORMAT or not isinstance(header["provenance"], dict):
        raise ValueError("not the header of a model")
    if header["version"] != FORMAT_VERSION:
        raise ModelError(f"is of version {header['version']!r:.20}, not {FORMAT_VERSION}")
    boxes = [arrays[name] for name in _BOX_NAMES if name in arrays]
    model = LinearModel(
        FeatureSettings.model_validate(header["features"]),
        **{name: arrays[name] for name in _NAMES},
        provenance=header["provenance"],
        box_regression=BoxRegression(boxes[0], boxes[1]) if boxes else None,
    )
    _check_arrays(model)
    return model


def _check_arrays(model: LinearModel) -> None:
    members = model.biases.size
    if not members:
        raise ModelError("has no SVM")
    shapes = {
        "weights": (members, model.features.length),
        "box_weights": (4, model.features.hog_length),
        "box_biases": (4,),
    }
    for name, array in _arrays(model).items():
        shape = shapes.get(name, (members,))
        if array.dtype != np.float32 or array.shape != shape or not (abs(array) <= MAX_VALUE).all():
            raise ModelError(f"its {name} are damaged, or not of shape {shape}")

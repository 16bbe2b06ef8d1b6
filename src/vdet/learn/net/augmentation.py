"""Training pictures for the network: places, scales, mosaics and colours changed at random."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import BoolArray, Float32Array, Float64Array, Image
from vdet.config.train import NetworkTrainingSettings
from vdet.detect.onnx.preparation import GREY
from vdet.learn.net.pasting import Paster
from vdet.learn.net.sources import NetSample, NetSource, join
from vdet.learn.net.weather import with_weather

LEAST_SIDE = 8.0
"""Minimum longer side of a vehicle, pixels; smaller vehicles are ignored."""
_SCALES = 0.5, 2.0
"""Minimum and largest scale of a picture; at 1 its width fits."""
_MOSAIC_SCALES = 0.5, 1.5
"""Minimum and largest scale of the four pictures of a mosaic."""
_LEAST_VISIBLE = 0.25  # fraction of a vehicle that is left after cropping, else it is ignored
_ASPECT = 0.1  # most change of the width relative to the height
_TILTED = 0.25  # fraction of pictures that are turned
_TILT = 3.0  # deviation of their angles, degrees


@dataclass(frozen=True, slots=True)
class Drawing:
    """How pictures are drawn at a step of the training.

    `width` and `height` are the size of the pictures, pixels; `magnified` multiplies all scales.
    """

    width: int
    height: int
    magnified: float
    mosaics: float


class SampleDrawer:
    """Draws training pictures from sources.

    The probability of a source is proportional to its weight and to the square root of its size,
    that of a picture in it to `repeat_factors`.

    Parameters
    ----------
    sources
        Each with at least one sample.
    """

    def __init__(self, sources: Sequence[NetSource], settings: NetworkTrainingSettings) -> None:
        self._samples = [sample for source in sources for sample in source.samples]
        shares = np.concatenate(
            [
                np.full(
                    len(source.samples),
                    settings.weights.get(source.name, 1.0) / len(source.samples) ** 0.5,
                )
                for source in sources
            ]
        )
        factors = repeat_factors(self._samples, shares / shares.sum(), settings.repeat_threshold)
        self._shares = shares * factors / (shares * factors).sum()
        self._paster = Paster(self._samples)

    def draw(self, rng: np.random.Generator, drawing: Drawing) -> NetSample:
        """Return one training picture with the vehicles in it."""
        if rng.random() < drawing.mosaics:
            sample = self._mosaic(rng, drawing)
        else:
            scale = drawing.magnified * _scale(rng, _SCALES)
            sample = _place(rng, self._pick(rng), (drawing.width, drawing.height), scale)
        if rng.random() < 0.5:
            sample = _mirrored(sample)
        sample = self._paster.paste(rng, sample)
        visible = sample.boxes[~sample.ignored & _may_have_lamps(sample.boxes)]
        image = with_weather(rng, _recolored(rng, sample.image), visible)
        return _without_small(replace(sample, image=_with_noise(rng, image)))

    def _pick(self, rng: np.random.Generator) -> NetSample:
        return self._samples[int(rng.choice(len(self._samples), p=self._shares))]

    def _mosaic(self, rng: np.random.Generator, drawing: Drawing) -> NetSample:
        """Return four pictures that meet in a random point."""
        width, height = drawing.width, drawing.height
        x = round(width * rng.uniform(0.3, 0.7))
        y = round(height * rng.uniform(0.3, 0.7))
        image = np.empty((height, width, 3), np.uint8)
        parts = []
        places = (0, 0, x, y), (x, 0, width, y), (0, y, x, height), (x, y, width, height)
        for left, top, right, bottom in places:
            scale = drawing.magnified * _scale(rng, _MOSAIC_SCALES)
            fit = width / (right - left)  # the scale refers to the width of the whole picture
            part = _place(rng, self._pick(rng), (right - left, bottom - top), scale * fit / 2)
            image[top:bottom, left:right] = part.image
            moved = part.boxes + np.array([left, top, left, top], np.float32)
            parts.append(replace(part, boxes=moved))
        return join(parts, image)


def _may_have_lamps(boxes: Float32Array) -> BoolArray:
    """Return which boxes are no narrower than vehicles; people are."""
    sides = boxes[:, 2:] - boxes[:, :2]
    return np.asarray(sides[:, 0] > 0.45 * sides[:, 1], np.bool_)


def repeat_factors(
    samples: Sequence[NetSample], shares: Float64Array, threshold: float
) -> Float64Array:
    """Return how many times more often each picture is drawn for the rarest class in it.

    A class in a fraction f of the pictures, fewer than `threshold`, gives √(threshold / f).
    Source: Gupta et al., "LVIS", 2019 (repeat factor sampling).

    Parameters
    ----------
    shares
        Float64 `(n,)`: the probability of each picture before; the sum is 1.
    """
    present = [np.unique(sample.classes[~sample.ignored]) for sample in samples]
    count = 1 + max((int(item.max()) for item in present if len(item)), default=0)
    has = np.zeros((len(samples), count + 1), np.bool_)  # the last column: unknown kinds
    for row, item in zip(has, present, strict=True):
        row[item] = True
    fractions = np.maximum(shares @ has[:, :count], 1e-9)
    factors = np.maximum(1.0, np.sqrt(threshold / fractions))
    return np.asarray(np.where(has[:, :count], factors, 1.0).max(axis=1), np.float64)


def _scale(rng: np.random.Generator, limits: tuple[float, float]) -> float:
    return float(np.exp(rng.uniform(*np.log(limits))))


def _place(
    rng: np.random.Generator, sample: NetSample, size: tuple[int, int], scale: float
) -> NetSample:
    """Return a part of a picture of `size`; at scale 1 its width fits."""
    width, height = size
    rows, columns = sample.image.shape[:2]
    stretch = np.exp(rng.uniform(-_ASPECT, _ASPECT) / 2)
    factor = scale * width / columns
    x_factor, y_factor = factor * stretch, factor / stretch
    left = rng.uniform(*sorted((0.0, width - columns * x_factor)))
    top = rng.uniform(*sorted((0.0, height - rows * y_factor)))
    image = sample.image
    step = 1
    while min(x_factor, y_factor) * step < 0.5:  # the warp below reads four pixels only
        image = _image(cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
        step *= 2
    kept_x, kept_y = columns / image.shape[1], rows / image.shape[0]
    a, b = x_factor * kept_x, y_factor * kept_y
    shift_x, shift_y = left + a / 2 - 0.5, top + b / 2 - 0.5  # middles of pixels
    angle = rng.normal(0, _TILT) if rng.random() < _TILTED else 0.0
    turn = cv2.getRotationMatrix2D((width / 2, height / 2), angle, 1.0)
    placing = np.array([[a, 0, shift_x], [0, b, shift_y], [0, 0, 1]])
    warped = cv2.warpAffine(image, turn @ placing, size, borderValue=(GREY,) * 3)
    factors = np.array([x_factor, y_factor] * 2, np.float32)
    offset = np.array([left, top] * 2, np.float32)
    boxes = _turned(sample.boxes * factors + offset, turn)
    return _cropped(NetSample(_image(warped), boxes, sample.classes, sample.ignored))


def _turned(boxes: Float32Array, turn: npt.ArrayLike) -> Float32Array:
    """Return boxes around the ellipses in boxes, `(n, 4)`, of a picture that was turned."""
    matrix = np.asarray(turn)
    middles = (boxes[:, :2] + boxes[:, 2:]) / 2 @ matrix[:, :2].T + matrix[:, 2]
    halves = np.sqrt(((boxes[:, 2:] - boxes[:, :2]) / 2) ** 2 @ (matrix[:, :2] ** 2).T)
    return np.concatenate([middles - halves, middles + halves], axis=1).astype(np.float32)


def _cropped(sample: NetSample) -> NetSample:
    """Cut boxes at the sides of the picture; vehicles of which little is left are ignored."""
    height, width = sample.image.shape[:2]
    limits = np.array([width, height, width, height], np.float32)
    cut = np.clip(sample.boxes, 0, limits)
    left = _areas(cut) / np.maximum(_areas(sample.boxes), 1e-6)
    keep = _areas(cut) > 0
    cropped = replace(sample, boxes=cut).ignoring(left < _LEAST_VISIBLE)
    return NetSample(
        sample.image, cropped.boxes[keep], cropped.classes[keep], cropped.ignored[keep]
    )


def _without_small(sample: NetSample) -> NetSample:
    """Ignore vehicles that are too small to be found."""
    sides = sample.boxes[:, 2:] - sample.boxes[:, :2]
    small = (sides.max(1, initial=0) < LEAST_SIDE) | (sides.min(1, initial=1e9) < LEAST_SIDE / 2)
    return sample.ignoring(small)


def _mirrored(sample: NetSample) -> NetSample:
    width = sample.image.shape[1]
    boxes = sample.boxes.copy()
    boxes[:, [0, 2]] = width - sample.boxes[:, [2, 0]]
    return replace(sample, image=sample.image[:, ::-1], boxes=boxes)


def _recolored(rng: np.random.Generator, image: Image) -> Image:
    """Change brightness, contrast, white balance, and sometimes the saturation."""
    gain = np.full(3, rng.uniform(0.6, 1.4))
    if rng.random() < 0.5:
        gain *= rng.uniform(0.85, 1.15, 3)
    offset = rng.uniform(-25, 25)
    table = np.arange(256)[:, np.newaxis] * gain + offset
    if rng.random() < 0.3:
        table = 255 * (np.clip(table, 0, 255) / 255) ** np.exp(rng.uniform(-0.4, 0.4))
    image = _image(cv2.LUT(image, np.clip(table, 0, 255).astype(np.uint8)[np.newaxis]))
    if rng.random() < 0.3:
        saturation = rng.uniform(0, 1.6)
        grey = cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)
        image = _image(cv2.addWeighted(image, saturation, grey, 1 - saturation, 0))
    return image


def _with_noise(rng: np.random.Generator, image: Image) -> Image:
    """Sometimes blur a picture, sometimes compress it, sometimes add noise."""
    if rng.random() < 0.15:
        image = _image(cv2.GaussianBlur(image, (0, 0), rng.uniform(0.4, 1.5)))
    if rng.random() < 0.15:
        quality = int(rng.integers(25, 80))
        coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
        image = _image(np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR)))
    if rng.random() < 0.15:
        noise = rng.normal(0, rng.uniform(2, 12), image.shape[:2]).astype(np.int16)
        image = np.clip(image + noise[..., np.newaxis], 0, 255).astype(np.uint8)
    return image


def _image(values: npt.ArrayLike) -> Image:
    return np.asarray(values, np.uint8)


def _areas(boxes: Float32Array) -> Float32Array:
    sides = np.maximum(boxes[:, 2:] - boxes[:, :2], 0)
    return np.asarray(sides[:, 0] * sides[:, 1], np.float32)

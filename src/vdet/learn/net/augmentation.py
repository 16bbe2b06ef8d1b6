"""Training images for the network: random views, mosaics, colours and pasted objects."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Float32Array, Float64Array, Image, area, coverage, iou_matrix
from vdet.config.schema import NetworkTrainingSettings
from vdet.detect.onnx.network import GREY
from vdet.learn.net.sources import NetSample, NetSource, join
from vdet.learn.net.weather import blended, draw_sign, with_weather

MIN_SIDE = 8.0
"""Minimum longer side of a vehicle, pixels; smaller vehicles are ignored."""
_SCALES = 0.5, 2.0
"""Smallest and largest scale of an image; at 1 its width fits."""
_CLOSE_UPS = 0.2
"""Fraction of images that show one vehicle near, sometimes cut off by the edge."""
_CLOSE_SIDES = 0.25, 1.2
"""Its longer side, fraction of the image's width."""
_MAX_MAGNIFICATION = 3.0
"""Of its pixels: what is smaller is not shown near."""
_MOSAIC_SCALES = 0.5, 1.5
"""Smallest and largest scale of the four images of a mosaic."""
_MIN_VISIBLE = 0.25  # fraction of a vehicle that is left after cropping, else it is ignored
_ASPECT = 0.1  # maximum change of the width relative to the height
REPEAT_THRESHOLD = 0.4
"""Images with a class that is in a smaller fraction of the images are drawn more often."""
_TILTED = 0.25  # fraction of images that are turned
_TILT = 3.0  # deviation of their angles, degrees

_PASTED = 0.3  # fraction of images that get pasted objects
_MAX_PASTED = 3  # objects in an image
_RARE = 0.5  # a class with fewer objects than this fraction of the mean is rare
_MARGIN = 0.2  # surroundings of a pasted object on each side, fraction of the box
_MIN_DONOR = 24.0  # longer side of an object to paste, pixels
_PASTED_SIDES = 16.0, 0.4  # of the longer side: minimum in pixels, maximum of the image's height
_MAX_COVERED = 0.45  # maximum fraction of another object that a pasted one hides
_SIGNS = 0.3  # fraction of images that get signs
_MAX_SIGNS = 3  # signs in an image


@dataclass(frozen=True, slots=True)
class ImageDrawing:
    """How images are drawn at a training step.

    `width` and `height` are the size of the images, pixels; `magnified` multiplies all scales.
    """

    width: int
    height: int
    magnified: float
    mosaics: float


class SampleDrawer:
    """Draws training images from sources.

    The probability of a source is proportional to its weight and to the square root of its size,
    that of an image in it to `repeat_factors`.

    Parameters
    ----------
    sources
        Each with at least one sample.
    """

    def __init__(self, sources: Sequence[NetSource], settings: NetworkTrainingSettings) -> None:
        self._samples = [sample for source in sources for sample in source.samples]
        sizes = [len(source.samples) for source in sources]
        weights = [settings.weights.get(source.name, 1.0) for source in sources]
        chances = np.repeat(np.array(weights) / np.sqrt(np.maximum(sizes, 1)), sizes)
        chances /= chances.sum()
        chances *= repeat_factors(self._samples, chances, REPEAT_THRESHOLD)
        self._chances = chances / chances.sum()
        self._paster = Paster(self._samples)

    def draw(self, rng: np.random.Generator, drawing: ImageDrawing) -> NetSample:
        """Return one training image with the vehicles in it."""
        size = drawing.width, drawing.height
        if rng.random() < _CLOSE_UPS:
            sample = _close_up(rng, self._pick(rng), size)
        elif rng.random() < drawing.mosaics:
            sample = self._mosaic(rng, drawing)
        else:
            scale = drawing.magnified * _scale(rng, _SCALES)
            sample = _random_view(rng, self._pick(rng), size, scale)
        if rng.random() < 0.5:
            sample = _mirrored(sample)
        sample = with_signs(rng, self._paster.paste(rng, sample))
        sides = sample.boxes[:, 2:] - sample.boxes[:, :2]
        may_have_lamps = ~sample.ignored & (sides[:, 0] > 0.45 * sides[:, 1])  # people have none
        image = _recolored(rng, sample.image)
        image = with_weather(rng, image, sample.boxes[may_have_lamps])
        small = (sides.max(axis=1) < MIN_SIDE) | (sides.min(axis=1) < MIN_SIDE / 2)
        return replace(sample.ignoring(small), image=_with_noise(rng, image))

    def _pick(self, rng: np.random.Generator) -> NetSample:
        return self._samples[int(rng.choice(len(self._samples), p=self._chances))]

    def _mosaic(self, rng: np.random.Generator, drawing: ImageDrawing) -> NetSample:
        """Return four images that meet in a random point."""
        width, height = drawing.width, drawing.height
        x = round(width * rng.uniform(0.3, 0.7))
        y = round(height * rng.uniform(0.3, 0.7))
        image = np.empty((height, width, 3), np.uint8)
        parts = []
        quarters = (0, 0, x, y), (x, 0, width, y), (0, y, x, height), (x, y, width, height)
        for left, top, right, bottom in quarters:
            scale = drawing.magnified * _scale(rng, _MOSAIC_SCALES)
            fit = width / (right - left)  # the scale refers to the width of the whole image
            part = _random_view(rng, self._pick(rng), (right - left, bottom - top), scale * fit / 2)
            image[top:bottom, left:right] = part.image
            moved = part.boxes + np.array([left, top, left, top], np.float32)
            parts.append(replace(part, boxes=moved))
        return join(parts, image)


def repeat_factors(
    samples: Sequence[NetSample], shares: Float64Array, threshold: float
) -> Float64Array:
    """Return how many times more often each image is drawn for the rarest class in it.

    A class in a fraction f of the images, fewer than `threshold`, gives √(threshold / f); images
    without any object count as a class.
    Source: Gupta et al., "LVIS", 2019 (repeat factor sampling).

    Parameters
    ----------
    shares
        Float64 `(n,)`: the probability of each image before; the sum is 1.
    """
    count = 1 + max(int(sample.classes.max(initial=0)) for sample in samples)
    learnt = [sample.classes[~sample.ignored] for sample in samples]
    has = [np.append(np.isin(np.arange(count), classes), len(classes) == 0) for classes in learnt]
    fractions = np.maximum(shares @ np.array(has), 1e-9)
    factors = np.where(has, np.sqrt(threshold / fractions), 1.0)
    return np.asarray(factors.max(axis=1).clip(1.0), np.float64)


class Paster:
    """Pastes objects of the rare classes in `samples` into images, with their surroundings.

    Source: Ghiasi et al., "Simple Copy-Paste is a Strong Data Augmentation Method", 2021.
    """

    def __init__(self, samples: Sequence[NetSample]) -> None:
        objects: dict[int, list[tuple[NetSample, int]]] = {}
        for sample in samples:
            for row in _whole(sample):
                objects.setdefault(int(sample.classes[row]), []).append((sample, row))
        limit = _RARE * sum(map(len, objects.values())) / max(1, len(objects))
        self._rare = [item for _, item in sorted(objects.items()) if len(item) < limit]

    def paste(self, rng: np.random.Generator, sample: NetSample) -> NetSample:
        """Return the sample, sometimes with objects of rare classes pasted into it."""
        if not self._rare or rng.random() >= _PASTED:
            return sample
        sample = replace(sample, image=sample.image.copy())
        for _ in range(int(rng.integers(1, _MAX_PASTED + 1))):
            rare = self._rare[int(rng.integers(len(self._rare)))]
            donor, row = rare[int(rng.integers(len(rare)))]
            sample = _paste(rng, sample, donor, row)
        return sample


def _whole(sample: NetSample) -> list[int]:
    """Return the rows of the objects that are large, inside the image, and not hidden."""
    height, width = sample.image.shape[:2]
    boxes, has_class = sample.boxes.astype(np.float64), sample.classes >= 0
    overlaps = iou_matrix(boxes, boxes) - np.eye(len(boxes))
    overlaps[:, sample.ignored & has_class] = 0  # the whole image
    large = (boxes[:, 2:] - boxes[:, :2]).max(1, initial=0) >= _MIN_DONOR
    inside = (boxes > 1).all(1) & (boxes[:, 2:] < np.array([width, height]) - 1).all(1)
    apart = overlaps.max(1, initial=0) < 0.1
    is_whole = large & inside & apart & has_class & ~sample.ignored
    return [int(row) for row in np.flatnonzero(is_whole)]


def _paste(rng: np.random.Generator, sample: NetSample, donor: NetSample, row: int) -> NetSample:
    """Paste one object into the image of a sample, unless it would cover others."""
    height, width = sample.image.shape[:2]
    box, limits = donor.boxes[row], np.array(donor.image.shape[1::-1] * 2)
    longer = float((box[2:] - box[:2]).max())
    largest = max(_PASTED_SIDES[0], min(_PASTED_SIDES[1] * height, 1.5 * longer))
    factor = _scale(rng, (_PASTED_SIDES[0], largest)) / longer
    margin = _MARGIN * np.tile(box[2:] - box[:2], 2) * (-1, -1, 1, 1)
    left, top, right, bottom = np.clip(box + margin, 0, limits).round().astype(int).tolist()
    method = cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR
    patch = cv2.resize(
        donor.image[top:bottom, left:right], None, fx=factor, fy=factor, interpolation=method
    )
    rows, columns = patch.shape[:2]
    free = height - rows - height // 4  # never near the top, where the sky is
    if free <= 0 or columns >= width:
        return sample
    x, y = int(rng.integers(width - columns)), height // 4 + int(rng.integers(free))
    inner = (box - np.array([left, top] * 2)) * factor
    pasted_box = (inner + np.array([x, y] * 2)).astype(np.float32)[np.newaxis]
    objects = sample.boxes[~sample.ignored].astype(np.float64)
    if coverage(objects, pasted_box.astype(np.float64)).max(initial=0) > _MAX_COVERED:
        return sample
    part = sample.image[y : y + rows, x : x + columns]
    opacity = _feather(columns, inner[0], inner[2]) * _feather(rows, inner[1], inner[3])[:, None]
    part[:] = blended(part, _image(patch), opacity)
    return replace(
        sample,
        boxes=np.concatenate([sample.boxes, pasted_box]),
        classes=np.append(sample.classes, donor.classes[row]),
        ignored=np.append(sample.ignored, False),
    )


def with_signs(rng: np.random.Generator, sample: NetSample) -> NetSample:
    """Sometimes draw signs into the image of a sample; they cover no object."""
    if rng.random() >= _SIGNS:
        return sample
    image, objects = sample.image.copy(), sample.boxes[~sample.ignored].astype(np.float64)
    for _ in range(int(rng.integers(1, _MAX_SIGNS + 1))):
        draw_sign(rng, image, objects)
    return replace(sample, image=image)


def _feather(count: int, near: float, far: float) -> Float64Array:
    """Return an opacity `(count,)`: 1 from `near` to `far`, falling to 0 at both ends."""
    ends = (0, max(near, 0.5), min(far, count - 0.5), count)
    return np.asarray(np.interp(np.arange(count) + 0.5, ends, (0, 1, 1, 0)))


def _scale(rng: np.random.Generator, limits: tuple[float, float]) -> float:
    return float(np.exp(rng.uniform(*np.log(limits))))


def _random_view(
    rng: np.random.Generator, sample: NetSample, size: tuple[int, int], scale: float
) -> NetSample:
    """Return a random view of an image, of `size`; at scale 1 its width fits."""
    factors = scale * size[0] / sample.image.shape[1] * _random_aspect(rng)
    return _view(rng, sample, size, factors, corner=rng.uniform(*_corners(sample, size, factors)))


def _close_up(rng: np.random.Generator, sample: NetSample, size: tuple[int, int]) -> NetSample:
    """Return a view in which one vehicle is large, or any view if all vehicles are small.

    The middle of the vehicle may be anywhere in the view, so the edge often cuts it off.
    """
    sides = (sample.boxes[:, 2:] - sample.boxes[:, :2]).max(axis=1, initial=0)
    smallest, largest = (fraction * size[0] for fraction in _CLOSE_SIDES)
    rows = np.flatnonzero(~sample.ignored & (_MAX_MAGNIFICATION * sides > smallest))
    if len(rows) == 0:
        return _random_view(rng, sample, size, _scale(rng, _SCALES))
    kind = rng.choice(np.unique(sample.classes[rows]))  # of mixed traffic, the rare classes too
    row = rng.choice(rows[sample.classes[rows] == kind])
    side = _scale(rng, (smallest, min(largest, _MAX_MAGNIFICATION * float(sides[row]))))
    factors = side / sides[row] * _random_aspect(rng)
    middle = (sample.boxes[row, :2] + sample.boxes[row, 2:]) / 2 * factors
    corner = rng.uniform(0, size) - middle
    return _view(
        rng, sample, size, factors, corner=np.clip(corner, *_corners(sample, size, factors))
    )


def _random_aspect(rng: np.random.Generator) -> Float64Array:
    """Return factors of width and height, whose product is 1."""
    aspect = np.exp(rng.uniform(-_ASPECT, _ASPECT) / 2)
    return np.array([aspect, 1 / aspect])


def _corners(
    sample: NetSample, size: tuple[int, int], factors: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return the least and the greatest corner of a scaled image with which it fills the view."""
    margin = np.array(size) - np.array(sample.image.shape[1::-1]) * factors
    return np.minimum(margin, 0), np.maximum(margin, 0)


def _view(
    rng: np.random.Generator,
    sample: NetSample,
    size: tuple[int, int],
    factors: Float64Array,
    corner: Float64Array,
) -> NetSample:
    """Return an image scaled by `factors` and moved to `corner`, in a view of `size`."""
    width, height = size
    whole = np.array(sample.image.shape[1::-1])
    angle = rng.normal(0, _TILT) if rng.random() < _TILTED else 0.0
    turn = np.asarray(cv2.getRotationMatrix2D((width / 2, height / 2), angle, 1.0))
    placing = turn @ np.vstack([np.column_stack([np.diag(factors), corner]), [0, 0, 1]])
    image = sample.image
    while (factors * whole < 0.5 * np.array(image.shape[1::-1])).all():  # warping skips pixels
        image = _image(cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    warping = placing.copy()  # from middle to middle of pixels
    warping[:, :2] *= whole / image.shape[1::-1]
    warping[:, 2] += warping[:, :2].sum(axis=1) / 2 - 0.5
    warped = _image(cv2.warpAffine(image, warping, size, borderValue=(GREY,) * 3))
    placed = NetSample(warped, _moved(sample.boxes, placing), sample.classes, sample.ignored)
    return _cropped(placed)


def _moved(boxes: Float32Array, placing: Float64Array) -> Float32Array:
    """Return boxes around the ellipses in boxes, `(n, 4)`, after an affine map, `(2, 3)`."""
    middles = (boxes[:, :2] + boxes[:, 2:]) / 2 @ placing[:, :2].T + placing[:, 2]
    halves = np.sqrt(((boxes[:, 2:] - boxes[:, :2]) / 2) ** 2 @ (placing[:, :2] ** 2).T)
    return np.concatenate([middles - halves, middles + halves], axis=1).astype(np.float32)


def _cropped(sample: NetSample) -> NetSample:
    """Cut boxes at the sides of the image; vehicles of which little is left are ignored."""
    limits = np.array(sample.image.shape[1::-1] * 2, np.float32)
    cut = np.clip(sample.boxes, 0, limits)
    areas, left = area(sample.boxes.astype(np.float64)), area(cut.astype(np.float64))
    cropped = replace(sample, boxes=cut).ignoring(left < _MIN_VISIBLE * areas)
    return cropped.of(left > 0)


def _mirrored(sample: NetSample) -> NetSample:
    boxes = sample.boxes.copy()
    boxes[:, [0, 2]] = sample.image.shape[1] - sample.boxes[:, [2, 0]]
    return replace(sample, image=sample.image[:, ::-1], boxes=boxes)


def _recolored(rng: np.random.Generator, image: Image) -> Image:
    """Change brightness, contrast, white balance, and sometimes the saturation."""
    gain = np.full(3, rng.uniform(0.6, 1.4))
    if rng.random() < 0.5:
        gain *= rng.uniform(0.85, 1.15, 3)
    table = np.clip(np.arange(256)[:, np.newaxis] * gain + rng.uniform(-25, 25), 0, 255)
    if rng.random() < 0.3:
        table = 255 * (table / 255) ** np.exp(rng.uniform(-0.4, 0.4))
    image = _image(cv2.LUT(image, table.astype(np.uint8)[np.newaxis]))
    if rng.random() < 0.3:
        saturation = rng.uniform(0, 1.6)
        grey = cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)
        image = _image(cv2.addWeighted(image, saturation, grey, 1 - saturation, 0))
    return image


def _with_noise(rng: np.random.Generator, image: Image) -> Image:
    """Sometimes blur an image, sometimes compress it, sometimes add noise."""
    if rng.random() < 0.15:
        image = _image(cv2.GaussianBlur(image, (0, 0), rng.uniform(0.4, 1.5)))
    if rng.random() < 0.15:
        quality = int(rng.integers(25, 80))
        coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
        image = _image(np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR)))
    if rng.random() < 0.15:
        noise = rng.standard_normal(image.shape[:2], np.float32) * rng.uniform(2, 12)
        of_channels = cv2.merge([noise.astype(np.int16)] * 3)
        image = _image(cv2.add(image, of_channels, dtype=cv2.CV_8U))
    return image


def _image(values: npt.ArrayLike) -> Image:
    return np.asarray(values, np.uint8)

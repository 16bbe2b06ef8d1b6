"""Training images: changed, combined, and in bad weather.

Night, fog, rain, drops on the lens, and signs, drawn into images of clear days.

Training images for the network: random views, mosaics, colours and pasted objects.
"""

import string
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Box, Float32Array, Float64Array, Image, area, coverage, iou_matrix
from vdet.config.schema import NetworkTrainingSettings
from vdet.detect.onnx.network import GREY
from vdet.learn.net.sources import NetSample, NetSource, join

_Values = npt.NDArray[Any]

_NIGHT = 0.14  # fraction of images
_DARK = 70.0  # mean of an image that is not darkened further
_FOG = 0.06
_RAIN = 0.1
_LAMP = (0.03, 0.09)  # radius of a lamp, fraction of the vehicle's width: smallest and largest
_TWO_LAMPS = 0.75  # minimum width of a vehicle with two lamps, fraction of its height
_STREET_LAMP = (0.6, 0.85, 1.0)  # BGR
_WIPED = 0.15  # fraction of images in rain with a wiper
_DROPS = 40  # maximum number of drops on the lens


def with_weather(rng: np.random.Generator, image: Image, boxes: Float32Array) -> Image:
    """Return the image at night, in fog or in the rain; most images stay as they are.

    Parameters
    ----------
    boxes
        The vehicles, `(n, 4)`: x1, y1, x2, y2, pixels. At night they have lamps.
    """
    chance = rng.random()
    if chance < _NIGHT:
        if image.mean() > _DARK:
            image = _at_night(rng, image, boxes)
        return _with_drops(rng, image) if rng.random() < 0.2 else image
    if chance < _NIGHT + _FOG:
        return _in_fog(rng, image)
    return _in_rain(rng, image) if chance < _NIGHT + _FOG + _RAIN else image


def _at_night(rng: np.random.Generator, image: Image, boxes: Float32Array) -> Image:
    """Darken the image, tint it, and light the lamps of vehicles and some others.

    The lamps of some images glare, and a wet road reflects them.
    """
    height, width = image.shape[:2]
    levels = np.arange(256)[:, np.newaxis] / 255
    levels = levels ** rng.uniform(1.1, 2.0) * rng.uniform(0.2, 0.8) * rng.uniform(0.75, 1.15, 3)
    light = np.zeros(image.shape, np.float32)

    def lamp(x: float, y: float, radius: float, color: tuple[float, float, float]) -> None:
        cv2.circle(light, (round(x), round(y)), max(1, round(radius)), color, -1)

    for x1, y1, x2, y2 in boxes[rng.random(len(boxes)) < 0.8].tolist():
        white, red = (0.9, rng.uniform(0.9, 1.0), 1.0), (0.1, 0.1, rng.uniform(0.6, 1.0))
        color = white if rng.random() < 0.6 else red
        y, inset = y1 + (y2 - y1) * rng.uniform(0.5, 0.75), (x2 - x1) * rng.uniform(0.08, 0.25)
        radius = (x2 - x1) * rng.uniform(*_LAMP)
        is_wide = x2 - x1 > _TWO_LAMPS * (y2 - y1)
        for x in (x1 + inset, x2 - inset) if is_wide else ((x1 + x2) / 2,):
            lamp(x, y, radius, color)
    for _ in range(int(rng.integers(0, 5))):
        x, y = rng.uniform(0, width), rng.uniform(0, height / 2)
        lamp(x, y, rng.uniform(0.5, 3.5), _STREET_LAMP)
    # A wide blur is computed at a quarter of the size.
    small = cv2.resize(light, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
    bloom = cv2.GaussianBlur(small, (0, 0), width / 4 * rng.uniform(0.004, 0.02))
    lit = np.asarray(cv2.LUT(image, levels[np.newaxis].astype(np.float32)), np.float32)
    lit += light
    lit += cv2.resize(bloom, (width, height)) * np.float32(rng.uniform(0.5, 2.5))
    if rng.random() < 0.3:  # a wet road
        length = int(height * rng.uniform(0.1, 0.25))
        mirrored = cv2.blur(light, (3, 2 * length + 1), anchor=(1, 2 * length))
        lit += mirrored * np.float32(rng.uniform(1, 4))
    return np.asarray(cv2.convertScaleAbs(lit, alpha=255), np.uint8)


def _in_fog(rng: np.random.Generator, image: Image) -> Image:
    """Blend the image with grey, more so at the top."""
    top = rng.uniform(0.3, 0.85)
    veil = np.linspace(top, top * rng.uniform(0.2, 0.8), len(image))[:, np.newaxis]
    grey = np.full_like(image, int(rng.uniform(120, 220)))
    return blended(image, grey, np.broadcast_to(veil, image.shape[:2]))


def _in_rain(rng: np.random.Generator, image: Image) -> Image:
    """Dull the image and draw streaks; often with drops on the lens, sometimes with a wiper."""
    height, width = image.shape[:2]
    rain = np.zeros((height, width), np.uint8)
    slant = rng.uniform(-0.3, 0.3)
    for _ in range(int(width * height * rng.uniform(0, 0.003))):
        x, y = int(rng.integers(width)), int(rng.integers(height))
        length = rng.uniform(0.01, 0.05) * height
        end = round(x + slant * length), round(y + length)
        cv2.line(rain, (x, y), end, int(rng.integers(60, 200)), 1)
    streaks = cv2.GaussianBlur(rain, (0, 0), 0.7) / 255.0
    grey, veil = rng.uniform(90, 190), rng.uniform(0, 0.6)  # low contrast, as behind spray
    light = rng.uniform(0.6, 1.0)
    dull = cv2.convertScaleAbs(image, alpha=(1 - veil) * light, beta=grey * veil * light)
    wet = blended(dull, np.full_like(dull, 200), streaks)
    if rng.random() < 0.7:
        wet = _with_drops(rng, wet)
    return _with_wiper(rng, wet) if rng.random() < _WIPED else wet


def _with_drops(rng: np.random.Generator, image: Image) -> Image:
    """Draw drops on the lens: each shows a blurred, upside-down image of what is around it."""
    height, width = image.shape[:2]
    blurred = cv2.GaussianBlur(image, (0, 0), 0.004 * width * rng.uniform(0.5, 2))
    shown, mask = blurred.copy(), np.zeros((height, width), np.uint8)
    for _ in range(int(rng.integers(3, _DROPS))):
        radius = max(2, int(width * 0.025 * rng.random() ** 2))
        x, y = int(rng.integers(width)), int(rng.integers(height))
        left, top = max(0, x - 2 * radius), max(0, y - 2 * radius)
        around = blurred[top : y + 2 * radius, left : x + 2 * radius][::-1, ::-1]
        part = shown[top : y + radius, left : x + radius]
        small = cv2.resize(around, part.shape[1::-1], interpolation=cv2.INTER_AREA)
        part[:] = cv2.convertScaleAbs(small, alpha=rng.uniform(0.7, 1.3))
        axes = radius, max(2, int(radius * rng.uniform(0.8, 1.6)))
        cv2.ellipse(mask, (x, y), axes, 0, 0, 360, 255, -1)
    return blended(image, shown, cv2.GaussianBlur(mask, (0, 0), 1.5) / 255.0)


def _with_wiper(rng: np.random.Generator, image: Image) -> Image:
    """Draw a dark, blurred wiper and what it smears."""
    height, width = image.shape[:2]
    mask = np.zeros((height, width), np.uint8)
    pivot = int(rng.integers(width)), height
    tip = int(pivot[0] + rng.uniform(-0.6, 0.6) * width), int(height * rng.uniform(0, 0.5))
    cv2.line(mask, pivot, tip, 255, max(2, int(width * rng.uniform(0.005, 0.025))))
    smeared = cv2.blur(image, (1 + 2 * int(0.01 * width), 1))
    dark = np.full_like(image, 25)
    return blended(smeared, dark, cv2.GaussianBlur(mask, (0, 0), 0.006 * width) / 255.0)


def blended(image: _Values, overlay: _Values, opacity: _Values) -> Image:
    """Return the image under another one, whose opacity is `(H, W)`, 0 to 1."""
    over = np.asarray(opacity, np.float32)
    return np.asarray(cv2.blendLinear(image, overlay, 1 - over, over), np.uint8)


_SIDES = 0.015, 0.4  # height of a sign, fraction of the image's height: smallest and largest
_POLYGONS = 3, 4, 8, 40  # corners: warning sign, diamond, stop sign, disc
_BOARD = 0.5  # fraction of signs that are boards with text
_ASPECTS = 0.25, 3.0  # width of a board relative to its height
_COLORS = (
    *((235, 235, 235), (40, 40, 200), (170, 90, 20), (70, 120, 20), (40, 190, 235)),
    *((30, 120, 240), (60, 60, 60), (40, 80, 120)),
)
"""BGR of signs: white, red, blue, green, yellow, orange, grey, brown."""
_LETTERS = [*(string.ascii_uppercase + string.digits)]
_MAX_DROP_COVERED = 0.2  # of an object


def draw_sign(rng: np.random.Generator, image: Image, objects: Float64Array) -> None:
    """Draw a sign at a random position into an image, unless it would cover an object there.

    Parameters
    ----------
    image
        BGR uint8 `(H, W, 3)`; it is changed.
    objects
        Their boxes, float64 `(n, 4)`: x1, y1, x2, y2, pixels.
    """
    height, width = image.shape[:2]
    tall = height * float(np.exp(rng.uniform(*np.log(_SIDES))))
    is_board = rng.random() < _BOARD
    aspect = float(np.exp(rng.uniform(*np.log(_ASPECTS)))) if is_board else 1.0
    wide = min(tall * aspect, 0.8 * width)
    x, y = rng.uniform(0, width - wide), rng.uniform(0, 0.8 * height)
    if coverage(objects, np.array([[x, y, x + wide, y + tall]])).max(initial=0) > _MAX_DROP_COVERED:
        return
    sign, opacity = _board(rng, wide / tall) if is_board else _plate(rng)
    if rng.random() < 0.7:
        _draw_post(rng, image, Box.sized(x, y, wide, tall))
    scale = np.array([max(2, wide) / sign.shape[1], max(2, tall) / sign.shape[0]])
    slant = rng.normal(0, 0.05, 2)
    placing = np.array([[scale[0], slant[0] * scale[1], x], [slant[1] * scale[0], scale[1], y]])
    margin = 0.2 * max(wide, tall) + 2  # for the slant
    left, top = max(0, int(x - margin)), max(0, int(y - margin))
    around = image[top : int(y + tall + margin), left : int(x + wide + margin)]
    placing[:, 2] -= left, top
    blur = 0.35 / float(scale.min())  # so that the sign is as sharp as the image
    layers = (cv2.GaussianBlur(layer, (0, 0), blur) for layer in (sign, opacity))
    size = around.shape[1], around.shape[0]
    warped, mask = (cv2.warpAffine(layer, placing, size) for layer in layers)
    lit = cv2.convertScaleAbs(warped, alpha=rng.uniform(0.45, 1.1))
    around[:] = blended(around, lit, mask / 255.0)


def _draw_post(rng: np.random.Generator, image: Image, sign: Box) -> None:
    """Draw a post from the middle of a sign down."""
    top = round((sign.x1 + sign.x2) / 2), round((sign.y1 + sign.y2) / 2)
    bottom = top[0], min(len(image), top[1] + round(sign.height * rng.uniform(1, 6)))
    thickness = max(1, round(min(sign.width, sign.height) * rng.uniform(0.04, 0.12)))
    cv2.line(image, top, bottom, (int(rng.integers(60, 190)),) * 3, thickness)


def _plate(rng: np.random.Generator) -> tuple[Image, Image]:
    """Return a traffic sign with a border and a symbol, `(128, 128, 3)`, and its opacity."""
    corners = _POLYGONS[int(rng.integers(len(_POLYGONS)))]
    first = {3: np.pi / 2 * rng.choice([-1, 1]), 4: np.pi / 4 * rng.integers(2), 8: np.pi / 8}
    angles = first.get(corners, 0.0) + np.arange(corners) * 2 * np.pi / corners
    outline = np.column_stack([np.cos(angles), np.sin(angles)])
    border, inside, ink = (_COLORS[n] for n in rng.integers(len(_COLORS), size=3).tolist())
    sign, opacity = np.zeros((128, 128, 3), np.uint8), np.zeros((128, 128), np.uint8)
    for radius, color in ((62, border), (62 * rng.uniform(0.6, 0.95), inside)):
        points = (64 + radius * outline).round().astype(np.int32)
        cv2.fillPoly(sign, [points], color)
        if radius == 62:
            cv2.fillPoly(opacity, [points], 255)
    if rng.random() < 0.5:
        _write(rng, sign, 64, 1.6, ink)
    else:
        symbol = (64 + rng.uniform(-30, 30, (int(rng.integers(3, 7)), 2))).astype(np.int32)
        cv2.fillPoly(sign, [symbol], ink)
    return sign, opacity


def _board(rng: np.random.Generator, aspect: float) -> tuple[Image, Image]:
    """Return a board with lines of text, 160 pixels high, and its opacity."""
    shape = 160, max(16, round(160 * aspect))
    color, ink = (_COLORS[n] for n in rng.integers(len(_COLORS), size=2).tolist())
    sign = np.full((*shape, 3), color, np.uint8)
    if rng.random() < 0.6:
        edge = shape[1] - 5, shape[0] - 5
        cv2.rectangle(sign, (4, 4), edge, ink, int(rng.integers(1, 6)))
    lines = int(rng.integers(0, 6))
    for line in range(lines):
        _write(rng, sign, round(160 * (line + 0.7) / (lines + 0.2)), 3.5 / (lines + 2), ink)
    for _ in range(int(rng.integers(0, 3))):  # panels, stripes, windows
        first = rng.uniform(0, 0.8, 2) * shape[::-1]
        last = first + rng.uniform(0.05, 0.5, 2) * shape[::-1]
        ends = [tuple(corner.round().astype(int).tolist()) for corner in (first, last)]
        panel = _COLORS[int(rng.integers(len(_COLORS)))]
        cv2.rectangle(sign, ends[0], ends[1], panel, -1)
    return sign, np.full(shape, 255, np.uint8)


def _write(
    rng: np.random.Generator, sign: Image, y: int, size: float, color: tuple[int, int, int]
) -> None:
    """Write random letters in the middle of the row `y`."""
    text = "".join(rng.choice(_LETTERS, int(rng.integers(1, 9))))
    (wide, tall), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size, 1)
    size *= min(1.0, 0.85 * sign.shape[1] / wide)
    (wide, tall), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size, 1)
    corner = (sign.shape[1] - wide) // 2, y + tall // 2
    thickness = max(1, round(4 * size))
    cv2.putText(sign, text, corner, cv2.FONT_HERSHEY_SIMPLEX, size, color, thickness, cv2.LINE_AA)


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
_MIN_PASTED_SIDE = 24.0  # longer side of an object to paste, or to paste in front of, pixels
_PASTED_SIDES = 16.0, 0.4  # of the longer side: minimum in pixels, maximum of the image's height
_MAX_COVERED = 0.45  # maximum fraction of another object that a pasted one hides
_MAX_ENLARGEMENT = 1.5  # maximum scale of a pasted object
_OCCLUDED = 0.4  # fraction of images in which an object is pasted in front of another one
_IN_FRONT = "car", "truck", "bus"  # classes of such objects
_FRONT_SIDES = 0.9, 1.4  # its longer side, as a multiple of that of the object behind it
_FRONT_MARGIN = 0.06  # its surroundings: few, as they cover the object behind it
_OVERLAP = 0.2, 0.6  # width that it covers, fraction of that of the narrower object
_LOWER = 0.3  # maximum distance of its lower edge below that of the other, fraction of its height
_SIGNS = 0.3  # fraction of images that get signs
_MAX_SIGNS = 3  # signs in an image


@dataclass(frozen=True, slots=True, eq=False)
class SampleObject:
    """An object of a sample: that in a row of its boxes."""

    sample: NetSample
    row: int

    @property
    def box(self) -> Float32Array:
        """x1, y1, x2, y2, `(4,)`, pixels of the sample."""
        return self.sample.boxes[self.row]

    @property
    def sides(self) -> Float32Array:
        """Width and height, `(2,)`, pixels of the sample."""
        return self.box[2:] - self.box[:2]


Objects = Sequence[Sequence[SampleObject]]
"""Objects by class."""


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
        objects = whole_objects(self._samples)
        self._rare = rare_objects(objects)
        classes = enumerate(settings.classes)
        self._fronts = [objects[n] for n, name in classes if name in _IN_FRONT and n in objects]

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
        sample = with_occlusion(rng, with_rare_objects(rng, sample, self._rare), self._fronts)
        sample = with_signs(rng, sample)
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


def whole_objects(samples: Sequence[NetSample]) -> dict[int, list[SampleObject]]:
    """Return the objects of each class that are large, inside the image, and not hidden."""
    objects: dict[int, list[SampleObject]] = {}
    for sample in samples:
        for row in _whole(sample):
            objects.setdefault(int(sample.classes[row]), []).append(SampleObject(sample, row))
    return dict(sorted(objects.items()))


def rare_objects(objects: Mapping[int, Sequence[SampleObject]]) -> Objects:
    """Return the objects of the rare classes."""
    limit = _RARE * sum(map(len, objects.values())) / max(1, len(objects))
    return [of_class for of_class in objects.values() if len(of_class) < limit]


def with_rare_objects(rng: np.random.Generator, sample: NetSample, rare: Objects) -> NetSample:
    """Sometimes paste objects of rare classes into a sample, with their surroundings.

    Source: Ghiasi et al., "Simple Copy-Paste is a Strong Data Augmentation Method", 2021.
    """
    if not rare or rng.random() >= _PASTED:
        return sample
    for _ in range(int(rng.integers(1, _MAX_PASTED + 1))):
        sample = _pasted_anywhere(rng, sample, _one_of(rng, rare))
    return sample


def with_occlusion(rng: np.random.Generator, sample: NetSample, fronts: Objects) -> NetSample:
    """Sometimes paste one of the objects in front of a part of an object of the sample.

    Without such images, the network often finds only one of two vehicles, one in front of the
    other.
    """
    sides = sample.boxes[:, 2:] - sample.boxes[:, :2]
    rows = np.flatnonzero(~sample.ignored & (sides.max(axis=1, initial=0) >= _MIN_PASTED_SIDE))
    if not fronts or rng.random() >= _OCCLUDED or not len(rows):
        return sample
    row = int(rng.choice(rows))
    front = _one_of(rng, fronts)
    factor = float(sides[row].max() / front.sides.max()) * _scale(rng, _FRONT_SIDES)
    if factor > _MAX_ENLARGEMENT:
        return sample
    width, height = factor * front.sides
    x1, _, x2, y2 = sample.boxes[row]
    hidden = rng.uniform(*_OVERLAP) * min(width, x2 - x1)
    x = x2 - hidden if rng.random() < 0.5 else x1 + hidden - width
    y = y2 + rng.uniform(0, _LOWER) * height - height  # nearer, and so lower
    box = Box.sized(x, y, width, height)
    return _pasted(sample, front, box, margin=_FRONT_MARGIN, max_covered=1 - _MIN_VISIBLE)


def _one_of(rng: np.random.Generator, objects: Objects) -> SampleObject:
    of_class = objects[int(rng.integers(len(objects)))]
    return of_class[int(rng.integers(len(of_class)))]


def _whole(sample: NetSample) -> list[int]:
    """Return the rows of the objects that are large, inside the image, and not hidden."""
    height, width = sample.image.shape[:2]
    boxes, has_class = sample.boxes.astype(np.float64), sample.classes >= 0
    overlaps = iou_matrix(boxes, boxes) - np.eye(len(boxes))
    overlaps[:, sample.ignored & has_class] = 0  # the whole image
    large = (boxes[:, 2:] - boxes[:, :2]).max(1, initial=0) >= _MIN_PASTED_SIDE
    inside = (boxes > 1).all(1) & (boxes[:, 2:] < np.array([width, height]) - 1).all(1)
    apart = overlaps.max(1, initial=0) < 0.1
    is_whole = large & inside & apart & has_class & ~sample.ignored
    return [int(row) for row in np.flatnonzero(is_whole)]


def _pasted_anywhere(rng: np.random.Generator, sample: NetSample, item: SampleObject) -> NetSample:
    """Return the sample with an object of random size at a random position: see `_pasted`."""
    height, width = sample.image.shape[:2]
    longer = float(item.sides.max())
    largest = max(_PASTED_SIDES[0], min(_PASTED_SIDES[1] * height, _MAX_ENLARGEMENT * longer))
    sides = item.sides * _scale(rng, (_PASTED_SIDES[0], largest)) / longer
    wide, tall = (1 + 2 * _MARGIN) * sides
    free = height - tall - height // 4  # never near the top, where the sky is
    if free <= 0 or wide >= width:
        return sample
    x = rng.uniform(0, width - wide) + _MARGIN * sides[0]
    y = height // 4 + rng.uniform(0, free) + _MARGIN * sides[1]
    box = Box.sized(x, y, *sides)
    return _pasted(sample, item, box, margin=_MARGIN, max_covered=_MAX_COVERED)


def _pasted(
    sample: NetSample, item: SampleObject, box: Box, *, margin: float, max_covered: float
) -> NetSample:
    """Return the sample with an object, scaled into a box.

    The sample stays as it is where the object would reach out of the image, or cover more of
    another one than the fraction `max_covered`. `margin` is the width of its surroundings, a
    fraction of its sides.
    """
    source = item.sample.image
    around = item.box + margin * np.tile(item.sides, 2) * (-1, -1, 1, 1)
    limits = np.array(source.shape[1::-1] * 2)
    left, top, right, bottom = np.clip(around, 0, limits).round().astype(int).tolist()
    factor = box.width / float(item.sides[0])
    method = cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR
    part = source[top:bottom, left:right]
    patch = cv2.resize(part, None, fx=factor, fy=factor, interpolation=method)
    rows, columns = patch.shape[:2]
    inner = (item.box - np.array([left, top] * 2)) * factor
    x, y = round(box.x1 - inner[0]), round(box.y1 - inner[1])
    height, width = sample.image.shape[:2]
    if x < 0 or y < 0 or x + columns > width or y + rows > height:
        return sample
    pasted_box = (inner + np.array([x, y] * 2)).astype(np.float32)[np.newaxis]
    objects = sample.boxes[~sample.ignored].astype(np.float64)
    if coverage(objects, pasted_box.astype(np.float64)).max(initial=0) > max_covered:
        return sample
    image = sample.image.copy()
    under = image[y : y + rows, x : x + columns]
    opacity = _feather(columns, inner[0], inner[2]) * _feather(rows, inner[1], inner[3])[:, None]
    under[:] = blended(under, _image(patch), opacity)
    return NetSample(
        image,
        np.concatenate([sample.boxes, pasted_box]),
        np.append(sample.classes, item.sample.classes[item.row]),
        np.append(sample.ignored, False),
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

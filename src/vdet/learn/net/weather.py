"""Night, fog, rain, drops on the lens, and signs, drawn into images of clear days."""

import string
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import Box, Float32Array, Float64Array, Image, coverage

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
_MAX_COVERED = 0.2  # of an object


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
    if coverage(objects, np.array([[x, y, x + wide, y + tall]])).max(initial=0) > _MAX_COVERED:
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

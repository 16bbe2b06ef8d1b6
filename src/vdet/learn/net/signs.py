"""Signs, plates and boards on posts, drawn into training images as background."""

import string

import cv2
import numpy as np

from vdet.boxes import Box, Float64Array, Image, coverage
from vdet.learn.net.weather import blended

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

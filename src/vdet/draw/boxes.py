"""Boxes with labels, drawn into BGR images."""

import colorsys

import cv2

from vdet.geometry import Box
from vdet.media.images import Image

Color = tuple[int, int, int]

GREEN: Color = (80, 220, 60)
WHITE: Color = (255, 255, 255)
_GOLDEN_RATIO = 0.618034
_FONT = cv2.FONT_HERSHEY_SIMPLEX


def color_of(number: int) -> Color:
    """Return a bright colour for an id; neighbouring ids differ clearly."""
    hue = (0.33 + number * _GOLDEN_RATIO) % 1
    red, green, blue = colorsys.hsv_to_rgb(hue, 0.85, 1)
    return round(255 * blue), round(255 * green), round(255 * red)


def line_width(image: Image) -> int:
    """Return a line width that looks the same at any frame height; 3 at 720 rows."""
    height: int = image.shape[0]
    return max(1, (height + 120) // 240)


def draw_box(image: Image, box: Box, color: Color, label: str = "") -> None:
    """Draw an outline just inside `box` and a label above it (inside, at the frame's top)."""
    for inset in range(line_width(image)):  # OpenCV's own thick lines are a pixel or two wider
        corner = (box.right - 1 - inset, box.bottom - 1 - inset)
        cv2.rectangle(image, (box.x + inset, box.y + inset), corner, color)
    if label:
        draw_label(image, label, (box.x, box.y), color)


def draw_label(image: Image, text: str, corner: tuple[int, int], color: Color) -> None:
    """Write dark text on a filled tag whose lower left corner is `corner`, `(x, y)`.

    The tag is moved so that it lies in the image.
    """
    scale = max(0.35, image.shape[0] / 1200)
    thickness = max(1, round(scale * 2))
    (width, height), baseline = cv2.getTextSize(text, _FONT, scale, thickness)
    pad = baseline // 2 + 1
    tag_width, tag_height = width + 2 * pad, height + baseline + pad
    x = max(0, min(corner[0], image.shape[1] - tag_width))
    y = max(0, min(corner[1] - tag_height, image.shape[0] - tag_height))
    cv2.rectangle(image, (x, y), (x + tag_width, y + tag_height), color, cv2.FILLED)
    origin = (x + pad, y + height + pad)
    cv2.putText(image, text, origin, _FONT, scale, (0, 0, 0), thickness, cv2.LINE_AA)

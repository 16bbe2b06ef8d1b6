"""Night, fog and rain, drawn into pictures of clear days."""

import cv2
import numpy as np

from vdet.boxes import Float32Array, Image

_NIGHT = 0.12  # share of pictures
_FOG = 0.05
_RAIN = 0.06
_LAMP = (0.03, 0.09)  # radius of a lamp's glare, share of the vehicle's width; least and most


def with_weather(rng: np.random.Generator, image: Image, boxes: Float32Array) -> Image:
    """Return the picture at night, in fog or in the rain; most pictures stay as they are.

    Parameters
    ----------
    boxes
        The vehicles, `(n, 4)`: x1, y1, x2, y2, pixels. At night they have lamps.
    """
    chance = rng.random()
    if chance < _NIGHT:
        return _at_night(rng, image, boxes)
    if chance < _NIGHT + _FOG:
        return _in_fog(rng, image)
    if chance < _NIGHT + _FOG + _RAIN:
        return _in_rain(rng, image)
    return image


def _at_night(rng: np.random.Generator, image: Image, boxes: Float32Array) -> Image:
    """Darken the picture, tint it, and light the lamps of vehicles and some others."""
    dark = (image / 255.0) ** rng.uniform(1.1, 2.0) * rng.uniform(0.3, 0.8)
    dark *= rng.uniform(0.75, 1.15, 3)
    light = np.zeros(image.shape, np.float32)
    for x1, y1, x2, y2 in boxes[rng.random(len(boxes)) < 0.8]:
        color = _lamp_color(rng)
        radius = max(1.0, (x2 - x1) * rng.uniform(*_LAMP))
        y = y1 + (y2 - y1) * rng.uniform(0.5, 0.75)
        inset = (x2 - x1) * rng.uniform(0.08, 0.25)
        for x in (x1 + inset, x2 - inset):
            cv2.circle(light, (round(float(x)), round(float(y))), round(float(radius)), color, -1)
    height, width = image.shape[:2]
    for _ in range(int(rng.integers(0, 5))):  # lamps of the street
        place = int(rng.integers(width)), int(rng.integers(height // 2 + 1))
        cv2.circle(light, place, int(rng.integers(1, 4)), (0.6, 0.85, 1.0), -1)
    bloom = cv2.GaussianBlur(light, (0, 0), width * rng.uniform(0.004, 0.02))
    lit = dark + light + bloom * rng.uniform(0.5, 2.5)
    return np.asarray(np.clip(lit * 255, 0, 255), np.uint8)


def _lamp_color(rng: np.random.Generator) -> tuple[float, float, float]:
    """Return the white of head lamps or the red of tail lamps, BGR."""
    if rng.random() < 0.6:
        return 0.9, float(rng.uniform(0.9, 1.0)), 1.0
    return 0.1, 0.1, float(rng.uniform(0.6, 1.0))


def _in_fog(rng: np.random.Generator, image: Image) -> Image:
    """Blend the picture with grey, more so at the top."""
    top = rng.uniform(0.3, 0.8)
    share = np.linspace(top, top * rng.uniform(0.2, 0.8), len(image))[:, np.newaxis, np.newaxis]
    fogged = image * (1 - share) + rng.uniform(120, 220) * share
    return np.asarray(fogged, np.uint8)


def _in_rain(rng: np.random.Generator, image: Image) -> Image:
    """Dull the picture and draw streaks, and sometimes drops on the glass."""
    height, width = image.shape[:2]
    rain = np.zeros((height, width), np.uint8)
    slant = rng.uniform(-0.3, 0.3)
    for _ in range(int(width * height * rng.uniform(0.0005, 0.003))):
        x, y = int(rng.integers(width)), int(rng.integers(height))
        length = rng.uniform(0.01, 0.05) * height
        end = round(x + slant * length), round(y + length)
        cv2.line(rain, (x, y), end, int(rng.integers(60, 200)), 1)
    streaks = cv2.GaussianBlur(rain, (0, 0), 0.7)[..., np.newaxis] / 255.0
    wet = image * rng.uniform(0.5, 0.9) * (1 - streaks) + 200 * streaks
    result = np.asarray(np.clip(wet, 0, 255), np.uint8)
    for _ in range(int(rng.integers(0, 6))):
        x, y = int(rng.integers(width)), int(rng.integers(height))
        size = max(3, int(rng.uniform(0.01, 0.04) * width))
        part = result[y : y + size, x : x + size]
        part[:] = cv2.blur(part, (size | 1, size | 1))
    return result

"""Pictures of coloured blocks on noise, with their boxes: a network learns them in seconds."""

import cv2
import numpy as np

from vdet.learn.net.sources import NetSample, NetSource

RED, BLUE = 0, 1
_COLORS = {RED: (30, 30, 220), BLUE: (220, 40, 30)}


def block_picture(seed: int, width: int = 256, height: int = 128) -> NetSample:
    """Return a noisy picture with one to three blocks that do not overlap; red 0, blue 1."""
    rng = np.random.default_rng(seed)
    image = rng.normal(120, 8, (height, width, 3)).clip(0, 255).astype(np.uint8)
    boxes, classes = [], []
    count = int(rng.integers(1, 4))
    for number in range(count):
        side = int(rng.integers(16, 56))
        x = number * width // count + int(rng.integers(0, width // count - side))
        y = int(rng.integers(0, height - side))
        kind = int(rng.integers(2))
        cv2.rectangle(image, (x, y), (x + side - 1, y + side - 1), _COLORS[kind], -1)
        boxes.append((x, y, x + side, y + side))
        classes.append(kind)
    ignored = np.zeros(count, np.bool_)
    return NetSample(image, np.array(boxes, np.float32), np.array(classes, np.int64), ignored)


def block_source(count: int = 60) -> NetSource:
    return NetSource("blocks", [block_picture(seed) for seed in range(count)])

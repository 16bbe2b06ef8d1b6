"""A grey road with textured rectangles for cars; the n-th has always the same texture."""

import numpy as np

from vdet.boxes import Box, Image


def textured_road(width: int, height: int, *boxes: Box | None) -> Image:
    frame = np.random.default_rng(99).integers(80, 90, (height, width, 3), dtype=np.uint8)
    for seed, box in enumerate(boxes):
        if box is not None:
            piece = np.random.default_rng(seed).integers(
                0, 256, box.cut(frame).shape, dtype=np.uint8
            )
            box.cut(frame)[:] = piece
    return frame

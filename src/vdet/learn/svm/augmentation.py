"""Augmentation: further samples made of a patch.

A mirrored road is a road too, the sides of the frame cut vehicles off, and a part of a vehicle must
not be taken for a vehicle.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np

from vdet.boxes import Float32Array, Image

CUT, PART = 0.15, 0.05
"""Fractions of the patches, and of their mirror images, that are cut off; of which a part is taken.
"""

_CUT_WIDTHS = (0.15, 0.5)  # of the patch's width
_PART_SIDES = (0.4, 0.6)  # of its width and height


@dataclass(frozen=True, slots=True, eq=False)
class PatchSample:
    """A picture to learn from.

    `image` is BGR uint8 `(H, W, 3)`. `sides` is float32 `(4,)`: left, top, right and bottom of the
    vehicle as `vdet.learn.svm.dataset.Sides` has them, NaN for unknown ones.
    """

    image: Image
    vehicle: bool
    sides: Float32Array


def augment(sample: PatchSample, rng: np.random.Generator) -> Iterator[PatchSample]:
    """Yield the samples made of a patch: its mirror image, and now and then a cut or a part."""
    mirror = mirrored(sample)
    yield mirror
    for whole in (sample, mirror):
        if rng.random() < CUT:
            yield cut_off(whole, rng.uniform(*_CUT_WIDTHS), left=rng.random() < 0.5)
        if whole.vehicle and rng.random() < PART:
            yield part_of(whole, rng)


def mirrored(sample: PatchSample) -> PatchSample:
    """Return the mirror image."""
    left, top, right, bottom = sample.sides
    sides = np.array([-right, top, -left, bottom], np.float32)
    return PatchSample(np.asarray(cv2.flip(sample.image, 1), np.uint8), sample.vehicle, sides)


def cut_off(sample: PatchSample, fraction: float, *, left: bool) -> PatchSample:
    """Return a sample cut off by the side of a frame; its outermost column is repeated beyond.

    Parameters
    ----------
    fraction
        How much of the width is cut off.
    left
        True for the frame's left side, False for its right side.
    """
    if left:
        return mirrored(cut_off(mirrored(sample), fraction, left=False))
    width = sample.image.shape[1]
    kept = width - round(fraction * width)
    image = np.take(sample.image, np.arange(width).clip(0, kept - 1), axis=1)
    sides = sample.sides.copy()
    across = sides[::2]
    across[across > kept / width - 0.5] = np.nan
    return replace(sample, image=image, sides=sides)


def part_of(sample: PatchSample, rng: np.random.Generator) -> PatchSample:
    """Return a random crop, which is not a vehicle and has no sides."""
    whole = np.array(sample.image.shape[1::-1])
    size = np.maximum(1, np.rint(rng.uniform(*_PART_SIDES) * whole)).astype(int)
    x, y = corner = rng.integers(0, whole - size + 1)
    right, bottom = corner + size
    image = np.ascontiguousarray(sample.image[y:bottom, x:right])
    return PatchSample(image, vehicle=False, sides=np.full(4, np.nan, np.float32))

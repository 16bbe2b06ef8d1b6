"""Augmentation: further samples made of a patch.

A mirrored road is a road too, the sides of the frame cut vehicles off, and a part of a vehicle must
not be taken for a vehicle.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np

from vdet.boxes import Float32Array, Image
from vdet.config.train import AugmentationSettings

_CUT_SHARES = (0.15, 0.5)  # of the patch's width
_PART_SHARES = (0.4, 0.6)  # of its width and height


@dataclass(frozen=True, slots=True, eq=False)
class PatchSample:
    """A picture to learn from.

    `image` is BGR uint8 `(H, W, 3)`. `sides` is float32 `(4,)`: left, top, right and bottom of the
    vehicle as `vdet.learn.svm.dataset.Sides` has them, NaN for unknown ones.
    """

    image: Image
    vehicle: bool
    sides: Float32Array


def augment(
    sample: PatchSample, seed: tuple[int, ...], settings: AugmentationSettings
) -> Iterator[PatchSample]:
    """Yield the samples made of a patch, without the patch itself.

    They depend on the settings and the seed alone. Switching one kind on does not change the
    others.
    """
    cuts, parts = (np.random.default_rng((*seed, kind)) for kind in range(2))
    whole = [sample]
    if settings.mirror:
        whole.append(mirrored(sample))
        yield whole[1]
    for each in whole:
        if cuts.random() < settings.cut:
            share, left = cuts.uniform(*_CUT_SHARES), cuts.random() < 0.5
            yield cut_off(each, share, left=left)
        if each.vehicle and parts.random() < settings.parts:
            yield part_of(each, parts)


def mirrored(sample: PatchSample) -> PatchSample:
    """Return the mirror image."""
    left, top, right, bottom = sample.sides
    sides = np.array([-right, top, -left, bottom], np.float32)
    return PatchSample(np.asarray(cv2.flip(sample.image, 1), np.uint8), sample.vehicle, sides)


def cut_off(sample: PatchSample, share: float, *, left: bool) -> PatchSample:
    """Return a sample cut off by the side of a frame; its outermost column is repeated beyond.

    Parameters
    ----------
    share
        The share of the width that is cut off.
    left
        True for the frame's left side, False for its right side.
    """
    if left:
        return mirrored(cut_off(mirrored(sample), share, left=False))
    width = sample.image.shape[1]
    kept = width - round(share * width)
    image = np.take(sample.image, np.arange(width).clip(0, kept - 1), axis=1)
    sides = sample.sides.copy()
    across = sides[::2]
    across[across > kept / width - 0.5] = np.nan
    return replace(sample, image=image, sides=sides)


def part_of(sample: PatchSample, rng: np.random.Generator) -> PatchSample:
    """Return a random crop, which is no vehicle and has no sides."""
    whole = np.array(sample.image.shape[1::-1])
    size = np.maximum(1, np.rint(rng.uniform(*_PART_SHARES) * whole)).astype(int)
    x, y = corner = rng.integers(0, whole - size + 1)
    right, bottom = corner + size
    image = np.ascontiguousarray(sample.image[y:bottom, x:right])
    return PatchSample(image, vehicle=False, sides=np.full(4, np.nan, np.float32))

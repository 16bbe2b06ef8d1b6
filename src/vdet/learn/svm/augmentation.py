"""Augmentation: further samples made of a patch.

A mirrored road is a road too, the sides of the frame cut vehicles off, and a part of a vehicle must
not be taken for a vehicle.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np

from vdet.boxes import Float32Array, Image
from vdet.config.train import AugmentationSettings

UNKNOWN_SIDES: tuple[float, ...] = (np.nan,) * 4

_CUT_SHARES = (0.15, 0.5)  # of the patch's width
_PART_SHARES = (0.4, 0.6)  # of its width and height
_ZOOM_SHARES = (0.6, 1.0)  # of its width and height


@dataclass(frozen=True, slots=True, eq=False)
class PatchSample:
    """A picture to learn from.

    `image` is BGR uint8 `(H, W, 3)`. `sides` is float32 `(4,)`: left, top, right and bottom of the
    vehicle as `vdet.learn.svm.dataset.Sides` has them, NaN for unknown ones.
    """

    image: Image
    vehicle: bool
    sides: Float32Array


Augmenter = Callable[[PatchSample, tuple[int, ...]], Iterator[PatchSample]]
"""Makes further samples of a sample and a seed."""


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
            unknown = np.array(UNKNOWN_SIDES, np.float32)
            yield replace(_crop(each, _PART_SHARES, parts), vehicle=False, sides=unknown)


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
    width = sample.image.shape[1]
    lost = round(share * width)
    kept = sample.image[:, lost:] if left else sample.image[:, : width - lost]
    before, after = (lost, 0) if left else (0, lost)
    image = cv2.copyMakeBorder(kept, 0, 0, before, after, cv2.BORDER_REPLICATE)
    edge = lost / width - 0.5 if left else 0.5 - lost / width
    sides = sample.sides.copy()
    across = sides[::2]
    across[across < edge if left else across > edge] = np.nan
    return replace(sample, image=np.asarray(image, np.uint8), sides=sides)


def zoom_in(sample: PatchSample, seed: tuple[int, ...]) -> Iterator[PatchSample]:
    """Yield one crop of most of a sample, in which its box is displaced and larger."""
    yield _crop(sample, _ZOOM_SHARES, np.random.default_rng(seed))


def _crop(
    sample: PatchSample, shares: tuple[float, float], rng: np.random.Generator
) -> PatchSample:
    """Return a random crop with a share of width and height between the two `shares`."""
    whole = np.array(sample.image.shape[1::-1])
    size = np.maximum(1, np.rint(rng.uniform(*shares) * whole)).astype(int)
    corner = rng.integers(0, whole - size + 1)
    (x, y), (right, bottom) = corner, corner + size
    shift = (corner + size / 2) / whole - 0.5
    sides = (sample.sides - np.tile(shift, 2)) * np.tile(whole / size, 2)
    image = np.ascontiguousarray(sample.image[y:bottom, x:right])
    return PatchSample(image, sample.vehicle, sides.astype(np.float32))

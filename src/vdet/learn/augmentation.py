"""Views: what else a camera could have shown of the thing in a patch.

Roads are mirrored in the next country, and the frame's sides cut vehicles off; a part of a vehicle
alone is not to be taken for one.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from vdet.config.schema import ViewSettings
from vdet.media.images import Image

SideValues = npt.NDArray[np.float32]
"""Left, top, right and bottom as `vdet.learn.dataset.Sides` has them, NaN for unknown ones."""

UNKNOWN: tuple[float, ...] = (np.nan,) * 4

_CUT_OFF = (0.15, 0.5)  # of the patch's width
_PART = (0.4, 0.6)  # of its side
_CLOSER = (0.6, 1.0)  # of its side


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A picture to learn from.

    `image` is BGR uint8 `(H, W, 3)`, `sides` float32 `(4,)` says where the vehicle is.
    """

    image: Image
    vehicle: bool
    sides: SideValues


Look = Callable[[View, tuple[int, ...]], Iterator[View]]
"""Gives the views of a patch, from a seed of its own."""


def views_of(patch: View, seed: tuple[int, ...], settings: ViewSettings) -> Iterator[View]:
    """Give the views of a patch, without the patch itself.

    Which they are depends on the settings and the seed alone; that one kind is on does not change
    the others.
    """
    cuts, parts = (np.random.default_rng((*seed, kind)) for kind in range(2))
    whole = [patch]
    if settings.mirror:
        whole.append(mirrored(patch))
        yield whole[1]
    for view in whole:
        if cuts.random() < settings.cut:
            share, left = cuts.uniform(*_CUT_OFF), cuts.random() < 0.5
            yield cut_off(view, share, left=left)
        if view.vehicle and parts.random() < settings.parts:
            yield _part(view, parts)


def mirrored(view: View) -> View:
    """Return what a mirror would show."""
    left, top, right, bottom = view.sides
    sides = np.array([-right, top, -left, bottom], np.float32)
    return View(np.asarray(cv2.flip(view.image, 1), np.uint8), view.vehicle, sides)


def cut_off(view: View, share: float, *, left: bool) -> View:
    """Return a view cut off by the side of a frame, whose outermost column is repeated beyond.

    Parameters
    ----------
    share
        What is cut off, of the width.
    left
        Whether it is the frame's left side, else the right.
    """
    width = view.image.shape[1]
    lost = round(share * width)
    kept = view.image[:, lost:] if left else view.image[:, : width - lost]
    before, after = (lost, 0) if left else (0, lost)
    image = cv2.copyMakeBorder(kept, 0, 0, before, after, cv2.BORDER_REPLICATE)
    edge = lost / width - 0.5 if left else 0.5 - lost / width
    sides = view.sides.copy()
    across = sides[::2]
    across[across < edge if left else across > edge] = np.nan
    return replace(view, image=np.asarray(image, np.uint8), sides=sides)


def closer(patch: View, seed: tuple[int, ...]) -> Iterator[View]:
    """Give one view of most of a patch, larger: a box in it moves and grows with it."""
    yield _crop(patch, _CLOSER, np.random.default_rng(seed))


def _part(view: View, rng: np.random.Generator) -> View:
    """Return a part of a vehicle, which is a non-vehicle."""
    return replace(_crop(view, _PART, rng), vehicle=False, sides=np.array(UNKNOWN, np.float32))


def _crop(view: View, shares: tuple[float, float], rng: np.random.Generator) -> View:
    """Return some part of a view, as wide and high as a share of it between the two."""
    whole = np.array(view.image.shape[1::-1])
    size = np.maximum(1, np.rint(rng.uniform(*shares) * whole)).astype(int)
    corner = rng.integers(0, whole - size + 1)
    (x, y), (right, bottom) = corner, corner + size
    shift = (corner + size / 2) / whole - 0.5
    sides = (view.sides - np.tile(shift, 2)) * np.tile(whole / size, 2)
    image = np.ascontiguousarray(view.image[y:bottom, x:right])
    return View(image, view.vehicle, sides.astype(np.float32))

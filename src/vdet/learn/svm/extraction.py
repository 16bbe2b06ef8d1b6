"""Feature vectors of patch files and of samples made from them."""

import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import BoolArray, Float32Array, Image
from vdet.config.kinds import FeatureSettings
from vdet.detect.svm.features import FeatureExtractor, resize
from vdet.errors import DataError
from vdet.learn.svm.dataset import NO_SIDES, PatchFile, read_patches
from vdet.workers import core_count

TEST_FRACTION = 0.2
"""Fraction of the patches held out for testing."""

RowNumbers = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class LabelledVectors:
    """Feature vectors of patches, each followed by those of its samples.

    Attributes
    ----------
    vectors
        float32 `(n, features)`.
    vehicle
        bool `(n,)`.
    sides
        float32 `(n, 4)`: left, top, right, bottom of each vehicle, NaN for unknown sides.
    origins
        intp `(n,)`: the number of the patch that a row shows or was made from.
    files
        The file of each patch.
    """

    vectors: Float32Array
    vehicle: BoolArray
    sides: Float32Array
    origins: RowNumbers
    files: Sequence[PatchFile]

    @property
    def is_boxed(self) -> BoolArray:
        """Which patches belong to neither class, bool `(patches,)`; they have sides."""
        return np.array([file.is_boxed for file in self.files])

    @property
    def groups(self) -> npt.NDArray[np.str_]:
        """The group of each patch, str `(patches,)`."""
        return np.array([file.group for file in self.files], str)

    @property
    def patches(self) -> RowNumbers:
        """The row of each patch itself, intp `(patches,)`."""
        return np.unique(self.origins, return_index=True)[1]

    @property
    def labels(self) -> BoolArray:
        """The labels of the patches, bool `(patches,)`."""
        return self.vehicle[self.patches]

    def of(self, kept: BoolArray) -> "LabelledVectors":
        """Return a copy of the kept patches, bool `(patches,)`, with their samples."""
        used = kept[self.origins]
        files = [file for file, is_kept in zip(self.files, kept, strict=True) if is_kept]
        origins = (np.cumsum(kept) - 1)[self.origins[used]]
        return LabelledVectors(
            self.vectors[used], self.vehicle[used], self.sides[used], origins, files
        )


def extract(
    files: Sequence[PatchFile],
    features: FeatureSettings,
    *,
    augmented: bool,
    jobs: int | None = None,
    progress: Callable[[int], object] = lambda _: None,
) -> LabelledVectors:
    """Compute the features of all patches, in the order of `files`.

    Parameters
    ----------
    augmented
        Also make samples from each patch. They depend only on the patch.
    jobs
        Number of threads; None: one for each core.
    progress
        Called with the number of patches done since the last call.

    Raises
    ------
    DataError
        A patch is unreadable.
    """
    from joblib import Parallel, delayed

    extractor = FeatureExtractor(features)

    def samples_by_patch() -> Iterator[list[PatchSample]]:
        for file, image in zip(files, read_patches(files), strict=True):
            if image is None:
                raise DataError(f"{file}: is not a readable image")
            whole = PatchSample(image, file.vehicle, np.array(file.sides or NO_SIDES, np.float32))
            rng = np.random.default_rng(zlib.crc32(image.tobytes()))
            yield [whole, *(augment(whole, rng) if augmented else ())]

    def describe(samples: Sequence[PatchSample]) -> tuple[Sequence[PatchSample], Float32Array]:
        patches = [resize(sample.image, features.patch, features.patch) for sample in samples]
        return samples, np.stack([extractor.describe(patch) for patch in patches])

    in_threads = Parallel(jobs or core_count(), backend="threading", return_as="generator")
    results = in_threads(delayed(describe)(samples) for samples in samples_by_patch())
    vectors: list[Float32Array] = []
    vehicle: list[bool] = []
    sides: list[Float32Array] = []
    origins: list[int] = []
    for number, (samples, described) in enumerate(results):
        vectors.append(described)
        vehicle += [sample.vehicle for sample in samples]
        sides += [sample.sides for sample in samples]
        origins += [number] * len(samples)
        progress(1)
    return LabelledVectors(
        np.concatenate(vectors), np.array(vehicle), np.array(sides), np.array(origins), files
    )


def hold_out(groups: npt.NDArray[np.str_]) -> BoolArray:
    """Choose the test patches: the last ones of each group, at least one and never all.

    Consecutive video frames, which are near-duplicates, are then in the same part, except where the
    two parts meet.

    Parameters
    ----------
    groups
        Shape `(n,)`: the group of each patch, the patches of a group in numeric order.

    Returns
    -------
    bool `(n,)`: True for the patches of the test.
    """
    held = np.zeros(len(groups), bool)
    for group in np.unique(groups):
        rows = np.flatnonzero(groups == group)
        count = min(max(1, round(len(rows) * TEST_FRACTION)), len(rows) - 1)
        held[rows[len(rows) - count :]] = True
    return held


CUT, PART = 0.15, 0.05
"""Fractions of the patches and their mirror images for cut-off samples, and for parts."""

_CUT_WIDTHS = (0.15, 0.5)  # of the patch's width
_PART_SIDES = (0.4, 0.6)  # of its width and height


@dataclass(frozen=True, slots=True, eq=False)
class PatchSample:
    """An image to learn from.

    `image` is BGR uint8 `(H, W, 3)`. `sides` is float32 `(4,)`: left, top, right and bottom of the
    vehicle as in `vdet.learn.svm.dataset.Sides`, NaN if unknown.
    """

    image: Image
    vehicle: bool
    sides: Float32Array


def augment(sample: PatchSample, rng: np.random.Generator) -> Iterator[PatchSample]:
    """Yield samples of a patch: its mirror image, and randomly a cut-off copy or a part."""
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
    """Return a sample cut off by the side of a frame; its outermost column is repeated.

    Parameters
    ----------
    fraction
        Fraction of the width to cut off.
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

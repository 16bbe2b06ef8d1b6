"""Patch files and the samples made of them → feature vectors."""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from vdet.boxes import BoolArray, Float32Array
from vdet.config.svm import FeatureSettings
from vdet.config.train import SvmTrainingSettings
from vdet.detect.svm.features import FeatureExtractor, to_patch
from vdet.errors import DataError
from vdet.learn.svm.augmentation import PatchSample, augment
from vdet.learn.svm.dataset import Patch, PatchFile, read_patches
from vdet.run.threads import map_ordered
from vdet.workers import core_count

TEST_SHARE = 0.2
"""Share of the patches that is held out for the test."""

RowNumbers = npt.NDArray[np.intp]
SplitName = Literal["random", "tail"]


@dataclass(frozen=True, slots=True, eq=False)
class LabelledVectors:
    """Feature vectors of patches, each before those of the samples made of it.

    Attributes
    ----------
    vectors
        float32 `(n, features)`.
    vehicle
        bool `(n,)`.
    sides
        float32 `(n, 4)`: left, top, right, bottom of each vehicle, NaN for unknown sides.
    origins
        intp `(n,)`: the number of the patch that a row shows or was made of.
    files
        The file of each patch.
    digest
        SHA-256 over the names, checksums and boxes of all patch files.
    """

    vectors: Float32Array
    vehicle: BoolArray
    sides: Float32Array
    origins: RowNumbers
    files: Sequence[PatchFile]
    digest: str = ""

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
        """Return a copy of the kept patches, bool `(patches,)`, with the samples made of them."""
        used = np.flatnonzero(kept[self.origins])
        new_rows = np.cumsum(kept) - 1
        vectors, vehicle, sides = self.vectors[used], self.vehicle[used], self.sides[used]
        files = [self.files[row] for row in np.flatnonzero(kept).tolist()]
        return LabelledVectors(vectors, vehicle, sides, new_rows[self.origins[used]], files)


def extract(
    files: Sequence[PatchFile],
    features: FeatureSettings,
    training: SvmTrainingSettings,
    *,
    augmented: bool = True,
    jobs: int | None = None,
    progress: Callable[[int], object] = lambda _: None,
) -> LabelledVectors:
    """Describe all patches; the result has the order of `files`.

    Parameters
    ----------
    training
        Has the seed and the settings of the augmentation. What is made of a patch depends on them
        and on the patch, not on the other patches.
    augmented
        Describe the samples made of each patch too.
    jobs
        Number of threads; None: one for each core.
    progress
        Called with the number of patches done since the last call.

    Raises
    ------
    DataError
        A patch is unreadable.
    """
    extractor = FeatureExtractor(features)
    digest = hashlib.sha256()
    broken: list[PatchFile] = []

    def samples() -> Iterator[list[PatchSample]]:
        for patch in read_patches(files):
            digest.update(_digest_line(patch))
            if patch.image is None:
                broken.append(patch.file)
                continue
            sides = np.array(patch.file.sides or (np.nan,) * 4, np.float32)
            whole = PatchSample(patch.image, patch.file.vehicle, sides)
            seed = training.seed, patch.checksum
            more = augment(whole, seed, training.augmentation) if augmented else ()
            yield [whole, *more]

    def describe(same: Sequence[PatchSample]) -> Float32Array:
        return extractor.describe_all(to_patch(each.image, features.patch) for each in same)

    vectors = [describe([])]
    labels: list[tuple[bool, Float32Array, int]] = []
    with map_ordered(describe, samples(), jobs or core_count()) as results:
        for number, (same, described) in enumerate(results):
            vectors.append(described)
            labels += [(each.vehicle, each.sides, number) for each in same]
            progress(1)
    if broken:
        raise DataError(f"{broken[0]}: {len(broken)} of {len(files)} patches are broken")
    vehicle, sides, origins = zip(*labels, strict=True) if labels else ((), (), ())
    return LabelledVectors(
        np.concatenate(vectors),
        np.array(vehicle, bool),
        np.reshape(sides, (-1, 4)).astype(np.float32),
        np.array(origins, np.intp),
        files,
        digest.hexdigest(),
    )


def _digest_line(patch: Patch) -> bytes:
    file = patch.file
    sides = f" {file.sides}" if file.sides else ""
    line = f"{file.group}/{file.name.rpartition('/')[2]} {patch.checksum:08x}{sides}\n"
    return line.encode("utf-8", "surrogateescape")  # a file name may be no valid text


def hold_out(groups: npt.NDArray[np.str_], name: SplitName, seed: int) -> BoolArray:
    """Choose the test patches: `TEST_SHARE` of them, at least one and never all of a part.

    Parameters
    ----------
    groups
        Shape `(n,)`: the group of each patch, the patches of a group in numeric order.
    name
        `random`: any patches, as in the original system. `tail`: the last ones of each group, so
        that consecutive video frames are on the same side, except where the two parts meet.

    Returns
    -------
    bool `(n,)`: True for the patches of the test.
    """
    held = np.zeros(len(groups), bool)
    parts = [np.random.default_rng(seed).permutation(len(groups))[::-1]]
    if name == "tail":
        parts = [np.flatnonzero(groups == group) for group in np.unique(groups)]
    for rows in parts:
        count = min(max(1, round(len(rows) * TEST_SHARE)), len(rows) - 1)
        held[rows[len(rows) - count :]] = True
    return held

"""Patch files and the samples made of them → feature vectors, in parallel."""

import hashlib
import logging
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
import numpy.typing as npt

from vdet.boxes import BoolArray, Float32Array
from vdet.config.svm import FeatureSettings
from vdet.config.train import SvmTrainingSettings
from vdet.detect.svm.features import FeatureExtractor, to_patch
from vdet.errors import DataError
from vdet.learn.svm.augmentation import UNKNOWN_SIDES, Augmenter, PatchSample
from vdet.learn.svm.dataset import PatchFile, read_patches
from vdet.workers import WorkerKilledError, Workers

log = logging.getLogger("vdet")

CHUNK = 128
"""Patches that a process describes at a time."""
MAX_NAMED = 10
"""At most this many broken patches are named in warnings."""

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
        SHA-256 over the names, checksums and boxes of all patch files, also the broken ones.
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
    workers: Workers,
    augmenter: Augmenter | None = None,
    progress: Callable[[int], object] = lambda _: None,
) -> LabelledVectors:
    """Describe all patches; the result has the order of `files`.

    Parameters
    ----------
    training
        Has the tolerated share of unreadable patches, which are named in warnings and skipped, and
        the seed of the augmenter.
    workers
        They describe the patches, `CHUNK` at a time.
    augmenter
        Makes samples of each patch, which are described too. They depend on the patch and the seed,
        not on the other patches.
    progress
        Called with the number of patches done since the last call.

    Raises
    ------
    DataError
        Too many patches are unreadable, or a worker process was killed.
    ClusterError
        The cluster of `workers` cannot be used.
    """
    describe = partial(_describe, features=features, augmenter=augmenter, seed=training.seed)
    parts = [files[i : i + CHUNK] for i in range(0, len(files), CHUNK)] or [[]]
    chunks: dict[int, tuple[LabelledVectors, list[int]]] = {}
    try:
        with closing(workers.map(describe, parts)) as results:
            for number, chunk in results:
                chunks[number] = chunk
                progress(len(parts[number]))
    except WorkerKilledError as error:
        raise DataError("a process was killed; with fewer --jobs it needs less memory") from error
    checksums = [each for number in range(len(parts)) for each in chunks[number][1]]
    data = _joined([chunks[number][0] for number in range(len(parts))])
    _check_broken(files, set(data.files), training.max_broken)
    return replace(data, digest=_digest(files, checksums))


def _describe(
    files: Sequence[PatchFile], features: FeatureSettings, augmenter: Augmenter | None, seed: int
) -> tuple[LabelledVectors, list[int]]:
    """Return the vectors of the files that are not broken, and the checksums of all files."""
    patches = list(read_patches(files))
    samples: list[PatchSample] = []
    origins: list[int] = []
    good: list[PatchFile] = []
    for patch in patches:
        if patch.image is not None:
            sides = np.array(patch.file.sides or UNKNOWN_SIDES, np.float32)
            sample = PatchSample(patch.image, patch.file.vehicle, sides)
            more = augmenter(sample, (seed, patch.checksum)) if augmenter else ()
            samples += (sample, *more)
            origins += [len(good)] * (len(samples) - len(origins))
            good.append(patch.file)
    images = (to_patch(sample.image, features.patch) for sample in samples)
    vectors = FeatureExtractor(features).describe_all(images)
    vehicle = np.array([sample.vehicle for sample in samples], bool)
    of_boxes = np.array([sample.sides for sample in samples], np.float32).reshape(-1, 4)
    data = LabelledVectors(vectors, vehicle, of_boxes, np.array(origins, np.intp), good)
    return data, [patch.checksum for patch in patches]


def _joined(chunks: Sequence[LabelledVectors]) -> LabelledVectors:
    firsts = np.cumsum([0, *(len(chunk.files) for chunk in chunks)])
    return LabelledVectors(
        np.concatenate([chunk.vectors for chunk in chunks]),
        np.concatenate([chunk.vehicle for chunk in chunks]),
        np.concatenate([chunk.sides for chunk in chunks]),
        np.concatenate([each.origins + first for each, first in zip(chunks, firsts, strict=False)]),
        [file for chunk in chunks for file in chunk.files],
    )


def _check_broken(files: Sequence[PatchFile], good: set[PatchFile], max_broken: float) -> None:
    broken = [file for file in files if file not in good]
    for file in broken[:MAX_NAMED]:
        log.warning("%s: is no readable picture; skipped", file)
    if len(broken) > MAX_NAMED:
        log.warning("… and %d more", len(broken) - MAX_NAMED)
    if len(broken) > max_broken * len(files):
        raise DataError(
            f"{broken[0]}: {len(broken)} of {len(files)} patches are broken (train.svm.max_broken)"
        )


def _digest(files: Sequence[PatchFile], checksums: Sequence[int]) -> str:
    digest = hashlib.sha256()
    for file, checksum in zip(files, checksums, strict=True):
        sides = f" {file.sides}" if file.sides else ""
        line = f"{file.group}/{file.name.rpartition('/')[2]} {checksum:08x}{sides}\n"
        digest.update(line.encode("utf-8", "surrogateescape"))  # a file name may be no valid text
    return digest.hexdigest()


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

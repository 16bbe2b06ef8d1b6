"""Patch files and the samples made of them → feature vectors, in parallel."""

import hashlib
import logging
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
import numpy.typing as npt

from vdet.boxes import BoolArray, Float32Array
from vdet.config.schema import FeatureSettings, SvmTrainingSettings
from vdet.detect.svm.features import FeatureExtractor, to_patch
from vdet.errors import DataError
from vdet.learn.svm.augmentation import UNKNOWN_SIDES, Augmenter, Sample
from vdet.learn.svm.dataset import PatchFile, read_patches
from vdet.workers import WorkerKilledError, Workers

log = logging.getLogger("vdet")

CHUNK = 128
"""Patches that a process describes at a time."""
MAX_NAMED = 10
"""At most this many broken patches are named in warnings."""

RowNumbers = npt.NDArray[np.intp]
SplitName = Literal["random", "tail"]


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Feature vectors of patches, followed by those of the samples made of these patches.

    Attributes
    ----------
    vectors
        float32 `(n, features)`.
    vehicle
        bool `(n,)`.
    sides
        float32 `(n, 4)`: left, top, right, bottom of each vehicle, NaN for unknown sides.
    origins
        intp `(n,)`: the row of the patch that a sample was made of; a patch has its own row.
    """

    vectors: Float32Array
    vehicle: BoolArray
    sides: Float32Array
    origins: RowNumbers

    @classmethod
    def of_patches(
        cls, vectors: Float32Array, vehicle: BoolArray, sides: Float32Array | None = None
    ) -> "Rows":
        """Return rows without samples; without `sides`, no side is known."""
        if sides is None:
            sides = np.full((len(vehicle), 4), np.nan, np.float32)
        return cls(vectors, vehicle, sides, np.arange(len(vehicle)))

    @property
    def patches(self) -> int:
        """The number of patches; their rows come first."""
        return int(np.count_nonzero(self.origins == np.arange(len(self.origins))))

    def of(self, kept: BoolArray) -> "Rows":
        """Return a copy of the kept patches, bool `(patches,)`, with the samples made of them."""
        used = np.flatnonzero(kept[self.origins])
        new_rows = np.cumsum(kept) - 1
        return Rows(
            self.vectors[used],
            self.vehicle[used],
            self.sides[used],
            new_rows[self.origins[used]],
        )


@dataclass(frozen=True, slots=True, eq=False)
class LabelledVectors:
    """The feature vectors of a set of patches.

    `groups` is str `(patches,)`: the group of each patch. `digest` is the SHA-256 over the names,
    checksums and boxes of all patch files, `broken` the number of files that could not be read.
    """

    rows: Rows
    groups: npt.NDArray[np.str_]
    digest: str = ""
    broken: int = 0

    @property
    def vectors(self) -> Float32Array:
        """The vectors of the patches, float32 `(patches, features)`."""
        return self.rows.vectors[: len(self.groups)]

    @property
    def vehicle(self) -> BoolArray:
        """The labels of the patches, bool `(patches,)`."""
        return self.rows.vehicle[: len(self.groups)]


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
    chunks = _describe_all(describe, files, workers, progress)
    good = [each for chunk in chunks for each in chunk.good]
    _check_broken(files, good, training.max_broken)
    checksums = [each for chunk in chunks for each in chunk.checksums]
    return LabelledVectors(
        _joined(chunks),
        np.array([file.group for file, ok in zip(files, good, strict=True) if ok], str),
        _digest(files, checksums),
        good.count(False),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Chunk:
    """The rows of some patch files; `good` and `checksums` are of all files, also broken ones."""

    rows: Rows
    good: list[bool]
    checksums: list[int]


def _describe_all(
    describe: Callable[[Sequence[PatchFile]], _Chunk],
    files: Sequence[PatchFile],
    workers: Workers,
    progress: Callable[[int], object],
) -> list[_Chunk]:
    parts = [files[i : i + CHUNK] for i in range(0, len(files), CHUNK)]
    chunks: dict[int, _Chunk] = {}
    try:
        with closing(workers.map(describe, parts)) as results:
            for number, chunk in results:
                chunks[number] = chunk
                progress(len(parts[number]))
    except WorkerKilledError as error:
        raise DataError(
            "a process that described patches was killed; there may be too little memory: try "
            "fewer --jobs"
        ) from error
    return [chunks[number] for number in range(len(parts))]


def _describe(
    files: Sequence[PatchFile], features: FeatureSettings, augmenter: Augmenter | None, seed: int
) -> _Chunk:
    patches = list(read_patches(files))
    samples, seeds = [], []
    for patch in patches:
        if patch.image is not None:
            sides = np.array(patch.file.sides or UNKNOWN_SIDES, np.float32)
            samples.append(Sample(patch.image, patch.file.vehicle, sides))
            seeds.append((seed, patch.checksum))
    origins = list(range(len(samples)))
    if augmenter is not None:
        for row in range(len(samples)):
            made = list(augmenter(samples[row], seeds[row]))
            samples += made
            origins += [row] * len(made)
    rows = Rows(
        FeatureExtractor(features).describe_all(
            to_patch(sample.image, features.patch) for sample in samples
        ),
        np.array([sample.vehicle for sample in samples], bool),
        np.array([sample.sides for sample in samples], np.float32).reshape(-1, 4),
        np.array(origins, np.intp),
    )
    good = [patch.image is not None for patch in patches]
    return _Chunk(rows, good, [patch.checksum for patch in patches])


def _joined(chunks: list[_Chunk]) -> Rows:
    """Join all rows, patches first; empty `chunks` on the way: the vectors are in memory once."""
    patches = [chunk.good.count(True) for chunk in chunks]
    samples = [len(chunk.rows.origins) - n for chunk, n in zip(chunks, patches, strict=True)]
    numbers = np.arange(sum(patches) + sum(samples))
    parts = np.split(numbers, np.cumsum([*patches, *samples])[:-1])
    halves = parts[: len(chunks)], parts[len(chunks) :]
    places = [np.concatenate(pair) for pair in zip(*halves, strict=True)]
    joined = Rows(
        np.empty((len(numbers), chunks[0].rows.vectors.shape[1]), np.float32),
        np.empty(len(numbers), bool),
        np.empty((len(numbers), 4), np.float32),
        numbers,
    )
    while chunks:
        rows, place = chunks.pop().rows, places.pop()
        joined.vectors[place] = rows.vectors
        joined.vehicle[place] = rows.vehicle
        joined.sides[place] = rows.sides
        joined.origins[place] = place[rows.origins]
    return joined


def _check_broken(files: Sequence[PatchFile], good: Sequence[bool], max_broken: float) -> None:
    broken = [file for file, ok in zip(files, good, strict=True) if not ok]
    for file in broken[:MAX_NAMED]:
        log.warning("%s: is no readable picture; skipped", file)
    if len(broken) > MAX_NAMED:
        log.warning("… and %d more", len(broken) - MAX_NAMED)
    if len(broken) > max_broken * len(files):
        raise DataError(
            f"{broken[0]}: {len(broken)} of {len(files)} patches are broken, more than the "
            f"{max_broken:.1%} of train.svm.max_broken; get the data set again"
        )


def _digest(files: Sequence[PatchFile], checksums: Sequence[int]) -> str:
    digest = hashlib.sha256()
    for file, checksum in zip(files, checksums, strict=True):
        sides = f" {file.sides}" if file.sides else ""
        line = f"{file.group}/{file.name.rpartition('/')[2]} {checksum:08x}{sides}\n"
        digest.update(line.encode("utf-8", "surrogateescape"))  # a file name may be no valid text
    return digest.hexdigest()


TEST_SHARE = 0.2
"""Share of the patches that is held out for the test."""


def hold_out(
    groups: npt.NDArray[np.str_], name: SplitName, fraction: float, seed: int
) -> BoolArray:
    """Choose the test patches.

    Parameters
    ----------
    groups
        Shape `(n,)`: the group of each patch, the patches of a group in numeric order.
    name
        `random`: any patches, as in the original system. `tail`: the last ones of each group, so
        that consecutive video frames are on the same side, except where the two parts meet.
    fraction
        Share of patches to hold out, 0 to 1; at least one patch and never all of a part.

    Returns
    -------
    bool `(n,)`: True for the patches of the test.
    """
    held = np.zeros(len(groups), bool)
    if name == "random":
        order = np.random.default_rng(seed).permutation(len(groups))
        held[order[: _count(len(groups), fraction)]] = True
    else:
        for group in np.unique(groups):
            (rows,) = np.nonzero(groups == group)
            held[rows[len(rows) - _count(len(rows), fraction) :]] = True
    return held


def _count(total: int, fraction: float) -> int:
    return min(max(1, round(total * fraction)), total - 1)

"""Patch files and their augmented samples → feature vectors, in parallel."""

import hashlib
import logging
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from vdet.boxes import BoolArray, Float32Array
from vdet.config.schema import FeatureSettings
from vdet.detect.svm.features import FeatureExtractor, to_patch
from vdet.errors import DataError
from vdet.learn.svm.augmentation import UNKNOWN_SIDES, Augmenter, Sample
from vdet.learn.svm.dataset import PatchFile, read_patches
from vdet.media.images import Image
from vdet.workers import WorkerKilledError, Workers

log = logging.getLogger("vdet")

CHUNK = 128
"""Patches that a process describes at a time."""
MAX_NAMED = 10
"""Most broken patches that are named in warnings."""

RowNumbers = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class SampleVectors:
    """Feature vectors of samples to learn from, row by row.

    `vectors` is float32 `(n, features)`, `vehicle` bool `(n,)`, `sides` float32 `(n, 4)` as in
    `LabelledVectors`. `origins` is intp `(n,)`: the row of the patch that the sample was made of; a
    patch has its own row.
    """

    vectors: Float32Array
    vehicle: BoolArray
    sides: Float32Array
    origins: RowNumbers


@dataclass(frozen=True, slots=True)
class LabelledVectors:
    """Feature vectors of patches with their labels, row by row.

    Attributes
    ----------
    vectors
        float32 `(n, features)`.
    vehicle
        bool `(n,)`.
    groups
        str `(n,)`.
    digest
        SHA-256 over the names, checksums and boxes of all patch files.
    broken
        Number of patch files that could not be read.
    sides
        float32 `(n, 4)`: left, top, right, bottom of each row's vehicle, NaN for unknown sides.
        None if no side is known.
    augmented
        Samples made of the patches, which only the training may use; None if there are none.
    """

    vectors: Float32Array
    vehicle: BoolArray
    groups: npt.NDArray[np.str_]
    digest: str
    broken: int
    sides: Float32Array | None = None
    augmented: SampleVectors | None = None


def extract(
    files: Sequence[PatchFile],
    settings: FeatureSettings,
    *,
    max_broken: float,
    workers: Workers,
    augmenter: Augmenter | None = None,
    seed: int = 0,
    progress: Callable[[int], object] = lambda _: None,
) -> LabelledVectors:
    """Describe all patches; the result has the order of `files`.

    Parameters
    ----------
    max_broken
        Tolerated share of unreadable patches; they are named in warnings and skipped.
    workers
        They describe the patches, `CHUNK` at a time.
    augmenter
        Makes further samples of each patch, which are described too; None for none.
    seed
        Seed of the augmenter. The samples of a patch depend on it and on the patch, not on the
        other patches.
    progress
        Called with the number of patches done since the last call.

    Raises
    ------
    DataError
        More patches than `max_broken` are unreadable, or a worker process was killed.
    ClusterError
        The cluster of `workers` cannot be used.
    """
    chunks = [files[i : i + CHUNK] for i in range(0, len(files), CHUNK)]
    describe = partial(_describe_chunk, settings=settings, augmenter=augmenter, seed=seed)
    parts = _describe_chunks(describe, chunks, workers, progress)
    good = np.concatenate([part.good for part in parts])
    _check_broken([file for file, ok in zip(files, good, strict=True) if not ok], files, max_broken)
    kept = [file for file, ok in zip(files, good, strict=True) if ok]
    digest = _digest(files, [checksum for part in parts for checksum in part.checksums])
    vectors, augmented = _joined(parts)
    return LabelledVectors(
        vectors,
        np.array([file.vehicle for file in kept], bool),
        np.array([file.group for file in kept], str),
        digest,
        len(files) - len(kept),
        np.array([file.sides or UNKNOWN_SIDES for file in kept], np.float32),
        augmented,
    )


def _describe_chunks(
    describe: Callable[[Sequence[PatchFile]], "_Chunk"],
    chunks: Sequence[Sequence[PatchFile]],
    workers: Workers,
    progress: Callable[[int], object],
) -> list["_Chunk"]:
    parts: dict[int, _Chunk] = {}
    try:
        with closing(workers.map(describe, chunks)) as results:
            for number, part in results:
                parts[number] = part
                progress(len(chunks[number]))
    except WorkerKilledError as error:
        raise DataError(
            "a process that described patches was killed; there may be too little memory: try "
            "fewer --jobs"
        ) from error
    return [parts[number] for number in range(len(chunks))]


@dataclass(frozen=True, slots=True)
class _Chunk:
    """What is returned for some patch files: `good` bool per file, the rest per readable file."""

    vectors: Float32Array
    augmented: SampleVectors
    good: BoolArray
    checksums: list[int]


def _describe_chunk(
    files: Sequence[PatchFile], settings: FeatureSettings, augmenter: Augmenter | None, seed: int
) -> _Chunk:
    extractor = FeatureExtractor(settings)
    patches = list(read_patches(files))
    readable = [
        (_sample(patch.file, patch.image), patch.checksum)
        for patch in patches
        if patch.image is not None
    ]
    augmented = [
        (row, each)
        for row, (sample, checksum) in enumerate(readable)
        for each in (augmenter(sample, (seed, checksum)) if augmenter else ())
    ]
    return _Chunk(
        extractor.describe_all(to_patch(sample.image, settings.patch) for sample, _ in readable),
        SampleVectors(
            extractor.describe_all(to_patch(each.image, settings.patch) for _, each in augmented),
            np.array([each.vehicle for _, each in augmented], bool),
            np.array([each.sides for _, each in augmented], np.float32).reshape(-1, 4),
            np.array([row for row, _ in augmented], np.intp),
        ),
        np.array([patch.image is not None for patch in patches]),
        [patch.checksum for patch in patches],
    )


def _sample(file: PatchFile, image: Image) -> Sample:
    return Sample(image, file.vehicle, np.array(file.sides or UNKNOWN_SIDES, np.float32))


def _joined(chunks: list[_Chunk]) -> tuple[Float32Array, SampleVectors]:
    """Join the vectors of all patches, and their samples; origins then count over all patches.

    `chunks` is emptied on the way, so that the vectors are in memory once.
    """
    made = [chunk.augmented for chunk in chunks]
    starts = np.cumsum([0, *(len(chunk.vectors) for chunk in chunks[:-1])])
    vehicle = np.concatenate([each.vehicle for each in made])
    sides = np.concatenate([each.sides for each in made])
    origins = np.concatenate([each.origins + at for each, at in zip(made, starts, strict=True)])
    width = chunks[0].vectors.shape[1]
    vectors = np.empty((sum(len(chunk.vectors) for chunk in chunks), width), np.float32)
    augmented = np.empty((len(vehicle), width), np.float32)
    del made
    end, augmented_end = len(vectors), len(augmented)
    while chunks:
        chunk = chunks.pop()
        end -= len(chunk.vectors)
        augmented_end -= len(chunk.augmented.vectors)
        vectors[end : end + len(chunk.vectors)] = chunk.vectors
        augmented[augmented_end : augmented_end + len(chunk.augmented.vectors)] = (
            chunk.augmented.vectors
        )
    return vectors, SampleVectors(augmented, vehicle, sides, origins)


def _check_broken(
    broken: Sequence[PatchFile], files: Sequence[PatchFile], max_broken: float
) -> None:
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

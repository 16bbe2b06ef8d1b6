"""Patch files → feature vectors, on all cores."""

import hashlib
import logging
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass

import joblib
import numpy as np
import numpy.typing as npt

from vdet.config.schema import FeatureSettings
from vdet.dataset import PatchFile, read_patches
from vdet.errors import DataError
from vdet.features import FeatureExtractor, Vectors, to_patch
from vdet.workers import deaf_to_ctrl_c, end_with

log = logging.getLogger("vdet")

CHUNK = 128
MAX_NAMED = 10


@dataclass(frozen=True, slots=True)
class LabelledVectors:
    """What a classifier learns from, row by row.

    `vectors` is float32 of shape `(n, features)`, `vehicle` bool of shape `(n,)`, `groups` str of
    shape `(n,)`. `digest` is a SHA-256 over the names and checksums of all patch files, `broken`
    how many of them could not be read.
    """

    vectors: Vectors
    vehicle: npt.NDArray[np.bool_]
    groups: npt.NDArray[np.str_]
    digest: str
    broken: int


def extract(
    files: Sequence[PatchFile],
    settings: FeatureSettings,
    *,
    max_broken: float,
    jobs: int = -1,
    progress: Callable[[int], object] = lambda _: None,
) -> LabelledVectors:
    """Describe all patches, in parallel processes, in the order given.

    Parameters
    ----------
    max_broken
        Share of unreadable patches that is tolerated; they are named in warnings and skipped.
    jobs
        Processes, as joblib counts them: -1 for one a core.
    progress
        Called with the number of patches done since the last call.

    Raises
    ------
    DataError
        More patches than `max_broken` are unreadable, or a process was killed.
    """
    chunks = [files[i : i + CHUNK] for i in range(0, len(files), CHUNK)]
    work = joblib.Parallel(
        n_jobs=jobs, return_as="generator", initializer=end_with, initargs=(os.getpid(),)
    )
    done: list[_Chunk] = []
    try:
        with deaf_to_ctrl_c():
            described: Iterator[_Chunk] = work(
                joblib.delayed(_describe_chunk)(chunk, settings) for chunk in chunks
            )
        for chunk, part in zip(chunks, described, strict=True):
            done.append(part)
            progress(len(chunk))
    except BrokenExecutor as error:
        raise DataError(
            "a process that described patches was killed; there may be too little memory: try "
            "fewer --jobs"
        ) from error
    good = np.concatenate([part.good for part in done])
    _check_broken([file for file, ok in zip(files, good, strict=True) if not ok], files, max_broken)
    kept = [file for file, ok in zip(files, good, strict=True) if ok]
    return LabelledVectors(
        np.concatenate([part.vectors for part in done]),
        np.array([file.vehicle for file in kept], bool),
        np.array([file.group for file in kept], str),
        _digest(files, [checksum for part in done for checksum in part.checksums]),
        len(files) - len(kept),
    )


@dataclass(frozen=True, slots=True)
class _Chunk:
    vectors: Vectors
    good: npt.NDArray[np.bool_]
    checksums: list[int]


def _describe_chunk(files: Sequence[PatchFile], settings: FeatureSettings) -> _Chunk:
    extractor = FeatureExtractor(settings)
    patches = list(read_patches(files))
    images = [to_patch(p.image, settings.patch) for p in patches if p.image is not None]
    good = np.array([p.image is not None for p in patches])
    return _Chunk(extractor.describe_all(images), good, [p.checksum for p in patches])


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
            f"{max_broken:.1%} of training.max_broken; get the data set anew"
        )


def _digest(files: Sequence[PatchFile], checksums: Sequence[int]) -> str:
    digest = hashlib.sha256()
    for file, checksum in zip(files, checksums, strict=True):
        line = f"{file.group}/{file.name.rpartition('/')[2]} {checksum:08x}\n"
        digest.update(line.encode("utf-8", "surrogateescape"))  # a name may be no text at all
    return digest.hexdigest()

"""Patch files, and views of them → feature vectors, on all cores."""

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
from vdet.detect.svm.features import FeatureExtractor, Vectors, to_patch
from vdet.errors import DataError
from vdet.learn.augmentation import UNKNOWN, Look, View
from vdet.learn.dataset import PatchFile, read_patches
from vdet.media.images import Image
from vdet.workers import end_with, ignore_sigint

log = logging.getLogger("vdet")

CHUNK = 128
MAX_NAMED = 10


Flags = npt.NDArray[np.bool_]
Rows = npt.NDArray[np.intp]
SidesTable = npt.NDArray[np.float32]
"""Shape `(n, 4)`: left, top, right, bottom of each row's vehicle, NaN for unknown ones."""


@dataclass(frozen=True, slots=True, eq=False)
class Views:
    """Described views of patches: what only a model's training may see.

    `vectors` is float32 of shape `(m, features)`, `vehicle` bool of shape `(m,)`, `sides` `(m, 4)`;
    `origins` is intp of shape `(m,)`, the row of the patch that each is a view of.
    """

    vectors: Vectors
    vehicle: Flags
    sides: SidesTable
    origins: Rows


@dataclass(frozen=True, slots=True)
class LabelledVectors:
    """What a classifier learns from, row by row.

    `vectors` is float32 of shape `(n, features)`, `vehicle` bool of shape `(n,)`, `groups` str of
    shape `(n,)`. `digest` is a SHA-256 over the names, checksums and boxes of all patch files,
    `broken` how many of them could not be read. `sides` is `(n, 4)`, `views` are those of the
    patches; None for either says that there are none.
    """

    vectors: Vectors
    vehicle: Flags
    groups: npt.NDArray[np.str_]
    digest: str
    broken: int
    sides: SidesTable | None = None
    views: Views | None = None


def extract(
    files: Sequence[PatchFile],
    settings: FeatureSettings,
    *,
    max_broken: float,
    look: Look | None = None,
    seed: int = 0,
    jobs: int = -1,
    progress: Callable[[int], object] = lambda _: None,
) -> LabelledVectors:
    """Describe all patches, in parallel processes, in the order given.

    Parameters
    ----------
    max_broken
        Share of unreadable patches that is tolerated; they are named in warnings and skipped.
    look
        Gives the views to describe too; None for none.
    seed
        Of the views. Those of a patch depend on it and on the patch, not on the other patches.
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
        with ignore_sigint():
            described: Iterator[_Chunk] = work(
                joblib.delayed(_describe_chunk)(chunk, settings, look, seed) for chunk in chunks
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
        np.array([file.sides or UNKNOWN for file in kept], np.float32),
        _joined([part.views for part in done], [len(part.vectors) for part in done]),
    )


def _joined(views: Sequence[Views], lengths: Sequence[int]) -> Views:
    """Join the views of chunks of these lengths; origins then count from the first chunk on."""
    starts = np.cumsum([0, *lengths[:-1]])
    return Views(
        np.concatenate([each.vectors for each in views]),
        np.concatenate([each.vehicle for each in views]),
        np.concatenate([each.sides for each in views]),
        np.concatenate([each.origins + start for each, start in zip(views, starts, strict=True)]),
    )


@dataclass(frozen=True, slots=True)
class _Chunk:
    vectors: Vectors
    views: Views
    good: Flags
    checksums: list[int]


def _describe_chunk(
    files: Sequence[PatchFile], settings: FeatureSettings, look: Look | None, seed: int
) -> _Chunk:
    extractor = FeatureExtractor(settings)
    patches = list(read_patches(files))
    shown = [(_shown(p.file, p.image), p.checksum) for p in patches if p.image is not None]
    seen = [
        (row, view)
        for row, (patch, checksum) in enumerate(shown)
        for view in (look(patch, (seed, checksum)) if look else ())
    ]
    return _Chunk(
        extractor.describe_all(to_patch(patch.image, settings.patch) for patch, _ in shown),
        Views(
            extractor.describe_all(to_patch(view.image, settings.patch) for _, view in seen),
            np.array([view.vehicle for _, view in seen], bool),
            np.array([view.sides for _, view in seen], np.float32).reshape(-1, 4),
            np.array([row for row, _ in seen], np.intp),
        ),
        np.array([patch.image is not None for patch in patches]),
        [patch.checksum for patch in patches],
    )


def _shown(file: PatchFile, image: Image) -> View:
    return View(image, file.vehicle, np.array(file.sides or UNKNOWN, np.float32))


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
        sides = f" {file.sides}" if file.sides else ""
        line = f"{file.group}/{file.name.rpartition('/')[2]} {checksum:08x}{sides}\n"
        digest.update(line.encode("utf-8", "surrogateescape"))  # a name may be no text at all
    return digest.hexdigest()

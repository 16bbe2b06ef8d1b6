"""Patch files, and views of them → feature vectors, in parallel."""

import hashlib
import logging
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from vdet.config.schema import FeatureSettings
from vdet.detect.svm.features import FeatureExtractor, Vectors, to_patch
from vdet.errors import DataError
from vdet.learn.augmentation import UNKNOWN, Look, View
from vdet.learn.dataset import PatchFile, read_patches
from vdet.media.images import Image
from vdet.workers import WorkerKilledError, Workers

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
    workers: Workers,
    look: Look | None = None,
    seed: int = 0,
    progress: Callable[[int], object] = lambda _: None,
) -> LabelledVectors:
    """Describe all patches; the result has the order of `files`.

    Parameters
    ----------
    max_broken
        Share of unreadable patches that is tolerated; they are named in warnings and skipped.
    workers
        They describe the patches, `CHUNK` at a time.
    look
        Gives the views to describe too; None for none.
    seed
        Of the views. Those of a patch depend on it and on the patch, not on the other patches.
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
    describe = partial(_describe_chunk, settings=settings, look=look, seed=seed)
    parts = _describe_chunks(describe, chunks, workers, progress)
    good = np.concatenate([part.good for part in parts])
    _check_broken([file for file, ok in zip(files, good, strict=True) if not ok], files, max_broken)
    kept = [file for file, ok in zip(files, good, strict=True) if ok]
    return LabelledVectors(
        np.concatenate([part.vectors for part in parts]),
        np.array([file.vehicle for file in kept], bool),
        np.array([file.group for file in kept], str),
        _digest(files, [checksum for part in parts for checksum in part.checksums]),
        len(files) - len(kept),
        np.array([file.sides or UNKNOWN for file in kept], np.float32),
        _joined([part.views for part in parts], [len(part.vectors) for part in parts]),
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

"""Labelled patches: read from folders or zip files, written to a zip file, and their features.

The layout is that of the Udacity set: `vehicles/<group>/*.png` and `non-vehicles/<group>/*.png`, in
folders, in zip files, or one class in each. A table beside these folders, `boxes.csv`, may give the
sides of the vehicle in a patch. Patches with a vehicle off their centre or of another size are then
in `boxes/<group>/`.
"""

import csv
import io
import math
import re
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

import cv2
import numpy as np
import numpy.typing as npt

from vdet.boxes import BoolArray, Float32Array, Image
from vdet.config.kinds import FeatureSettings
from vdet.detect.svm.model import describe, resize, split
from vdet.errors import DataError, escaped, printable
from vdet.files import is_hidden, staged
from vdet.media.images import IMAGE_SUFFIXES, decode_image
from vdet.workers import core_count

CLASSES = {"vehicles": True, "non-vehicles": False}
BOXED = "boxes"
"""Folder of the patches with box sides that belong to neither class."""
TABLE = "boxes.csv"
COLUMNS = ("name", "left", "top", "right", "bottom")
MAX_PATCH_BYTES = 16_000_000

Sides = tuple[float, float, float, float]
"""Left, top, right and bottom of a vehicle from the centre of a patch, in its widths and heights.

Right and down are positive; NaN for an unknown side, for example outside the frame.
"""

NO_SIDES: Sides = (math.nan, math.nan, math.nan, math.nan)
"""No side is known."""

_Root = Path | zipfile.Path
"""A folder, or the top of a zip file."""

AddPatch = Callable[[str, Image, Sides | None], None]
"""Adds a patch (BGR uint8) by name, with the sides of its vehicle."""

TEST_FRACTION = 0.2
"""Fraction of the patches held out for testing."""

RowNumbers = npt.NDArray[np.intp]

CUT, PART = 0.15, 0.05
"""Fractions of the patches and their mirror images for cut-off samples, and for parts."""

_CUT_WIDTHS = (0.15, 0.5)  # of the patch's width
_PART_SIDES = (0.4, 0.6)  # of its width and height


@dataclass(frozen=True, slots=True)
class PatchFile:
    """A patch file: `name` in the zip file or folder `source`."""

    source: Path
    name: str
    group: str
    """Class and folder, `vehicles/GTI_Far`; patches of one group may be near-duplicates."""
    vehicle: bool
    sides: Sides | None = None
    """Sides of the vehicle in the patch, if known."""

    @property
    def is_boxed(self) -> bool:
        """Whether it is in `boxes/` and belongs to neither class; it has `sides`."""
        return self.group.split("/")[0] == BOXED

    def __str__(self) -> str:
        return f"{self.source}: {printable(self.name)}"


def find_patches(sources: Sequence[Path]) -> list[PatchFile]:
    """List the patches, group by group, in numeric order of file names.

    Raises
    ------
    DataError
        A source cannot be read or has no patch, one of the two classes has no patch, or a table of
        boxes is damaged.
    """
    files = [file for source in dict.fromkeys(sources) for file in _find_in(source)]
    for name, vehicle in CLASSES.items():
        if not any(file.vehicle is vehicle and not file.is_boxed for file in files):
            raise DataError(f"{', '.join(map(str, sources))}: no images in {name}/<group>/")
    return sorted(files, key=lambda file: (file.group, _numeric(file.name), file.source))


def _find_in(source: Path) -> list[PatchFile]:
    root = _root_of(source)
    if isinstance(root, Path):  # only files: devices and pipes may be endless
        names = [p.relative_to(root).as_posix() for p in root.rglob("*") if p.is_file()]
    else:
        names = root.root.namelist()
    boxes = _read_table(source, root) if TABLE in names else {}
    files = [file for name in names if (file := _patch_file(source, name, boxes))]
    if not files:
        raise DataError(
            f"{source}: no images in vehicles/<group>/ or non-vehicles/<group>/; see vdet mine"
        )
    return files


def _patch_file(source: Path, name: str, boxes: Mapping[str, Sides]) -> PatchFile | None:
    """Return the patch file of a name in a source; None if it is not a patch."""
    path = PurePosixPath(name)
    if is_hidden(path) or path.suffix.lower() not in IMAGE_SUFFIXES:
        return None
    sides = boxes.get(name)
    classes = CLASSES | ({BOXED: True} if sides else {})
    folders = [source.resolve().name, *path.parts[:-1]]
    for depth in range(len(folders) - 1, -1, -1):
        if folders[depth] in classes:
            group = escaped("/".join(folders[depth:]))
            return PatchFile(source, name, group, classes[folders[depth]], sides)
    return None


def _numeric(name: str) -> list[tuple[int, str]]:
    """Return a sort key in which image10 follows image9; numbers may have any length."""
    parts = re.split(r"0*([0-9]+)", name)
    return [(len(part) if part.isdecimal() else 0, part) for part in parts]


def _root_of(source: Path) -> _Root:
    """Return a folder or the top of a zip file."""
    if source.is_dir():
        return source
    if not source.exists():
        raise DataError(f"{source}: folder or zip file not found")
    try:
        return zipfile.Path(source)
    except Exception as error:  # zipfile raises a dozen kinds on damaged data
        raise DataError(f"{source}: is not a folder or a readable zip file") from error


def read_patches(files: Sequence[PatchFile]) -> Iterator[Image | None]:
    """Yield the image of each patch, BGR uint8 of any size; None if it is unreadable.

    Each zip file is opened once.
    """
    roots = {source: _root_of(source) for source in {file.source for file in files}}
    for file in files:
        yield decode_image(_content(roots[file.source], file.name))


def _content(root: _Root, name: str) -> bytes:
    """Return the content of a file; empty if it cannot be read."""
    try:
        with root.joinpath(name).open("rb") as file:
            return file.read(MAX_PATCH_BYTES)  # a bomb is not unpacked any further
    except Exception:  # zipfile and zlib raise a dozen kinds on damaged data
        return b""


def _read_table(source: Path, root: _Root) -> dict[str, Sides]:
    """Return the sides of each patch in the source's table."""
    try:
        text = _content(root, TABLE).decode("utf-8")
        rows = list(csv.reader(io.StringIO(text, newline="")))
        if not rows or tuple(rows[0]) != COLUMNS:
            raise ValueError(f"its first line is not {','.join(COLUMNS)}")
        return {name: _sides(values) for name, *values in rows[1:]}
    except (ValueError, csv.Error) as error:
        raise DataError(f"{source}: {TABLE} is damaged ({error}); mine it again") from error


def _sides(values: Sequence[str]) -> Sides:
    left, top, right, bottom = (float(value or "nan") for value in values)
    return left, top, right, bottom


@contextmanager
def patch_archive(path: Path, *, overwrite: bool = False) -> Iterator[AddPatch]:
    """Write a zip file of patches as PNG images, with a table of all sides to four decimals.

    It appears at `path` if the block ends without an error. The same patches give the same bytes.
    Raises `OutputError`.
    """
    table = io.StringIO(newline="")
    rows = csv.writer(table, lineterminator="\n")
    rows.writerow(COLUMNS)
    with staged(path, overwrite=overwrite) as temporary, zipfile.ZipFile(temporary, "w") as file:

        def add(name: str, patch: Image, sides: Sides | None) -> None:
            _store(file, name, cv2.imencode(".png", patch)[1].tobytes())
            if sides is not None:
                rows.writerow(
                    [name, *("" if math.isnan(side) else f"{side:.4f}" for side in sides)]
                )

        yield add
        _store(file, TABLE, table.getvalue().encode())


def _store(archive: zipfile.ZipFile, name: str, data: bytes) -> None:
    """Write a member without time, so that the same data give the same file."""
    info = zipfile.ZipInfo(name)  # of the earliest time
    info.external_attr = 0o644 << 16
    archive.writestr(info, data)


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

    def samples_by_patch() -> Iterator[list[PatchSample]]:
        for file, image in zip(files, read_patches(files), strict=True):
            if image is None:
                raise DataError(f"{file}: is not a readable image")
            whole = PatchSample(image, file.vehicle, np.array(file.sides or NO_SIDES, np.float32))
            rng = np.random.default_rng(zlib.crc32(image.tobytes()))
            yield [whole, *(augment(whole, rng) if augmented else ())]

    def described(samples: Sequence[PatchSample]) -> tuple[Sequence[PatchSample], Float32Array]:
        patches = [resize(sample.image, features.patch, features.patch) for sample in samples]
        return samples, np.stack([describe(split(patch, features), features) for patch in patches])

    in_threads = Parallel(jobs or core_count(), backend="threading", return_as="generator")
    results = in_threads(delayed(described)(samples) for samples in samples_by_patch())
    vectors: list[Float32Array] = []
    vehicle: list[bool] = []
    sides: list[Float32Array] = []
    origins: list[int] = []
    for number, (samples, features_of_samples) in enumerate(results):
        vectors.append(features_of_samples)
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


@dataclass(frozen=True, slots=True, eq=False)
class PatchSample:
    """An image to learn from.

    `image` is BGR uint8 `(H, W, 3)`. `sides` is float32 `(4,)`: left, top, right and bottom of the
    vehicle as in `vdet.learn.svm.patches.Sides`, NaN if unknown.
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

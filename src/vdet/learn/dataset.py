"""Labelled patches from folders or zip files, with the group that each belongs to.

The layout is the Udacity set's: `vehicles/<group>/*.png` and `non-vehicles/<group>/*.png`, in
folders, in zip files, or one class in each. A table beside these folders, `boxes.csv`, may say
where in a patch the vehicle is; patches that show one, but ill placed, then lie in
`boxes/<group>/`.
"""

import csv
import io
import math
import re
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from vdet.archives import ArchiveError, list_members, open_archive, read_member
from vdet.errors import DataError
from vdet.files import escaped, printable, read_whole
from vdet.media.images import PICTURE_SUFFIXES, Image, decode_image

CLASSES = {"vehicles": True, "non-vehicles": False}
BOXED = "boxes"
"""Folder of the patches that tell where a vehicle is, and belong to neither class."""
TABLE = "boxes.csv"
COLUMNS = ("name", "left", "top", "right", "bottom")
MAX_PATCH_BYTES = 16_000_000

Sides = tuple[float | None, float | None, float | None, float | None]
"""Left, top, right and bottom of a vehicle, from the patch's centre in sides of the patch.

Right and down are positive; None for a side that is not known, for instance beyond the frame.
"""


@dataclass(frozen=True, slots=True)
class PatchFile:
    """Where a patch lies: in the zip file or folder `source`, under `name`."""

    source: Path
    name: str
    group: str
    """Class and folder, `vehicles/GTI_Far`; patches of one group may be near-duplicates."""
    vehicle: bool
    sides: Sides | None = None
    """Where in the patch the vehicle is, if that is known."""

    def __str__(self) -> str:
        return f"{self.source}: {printable(self.name)}"


@dataclass(frozen=True, slots=True)
class Patch:
    """A patch as read: BGR uint8 image of any size, None where it is broken, and its checksum."""

    file: PatchFile
    image: Image | None
    checksum: int


def find_patches(sources: Sequence[Path]) -> list[PatchFile]:
    """List the patches of both classes, group by group, in numeric order of file names.

    Raises
    ------
    DataError
        A source cannot be read, holds no patch, or is a zip file with a name in it that is given
        twice, leads out of the archive or is a symbolic link; one of the two classes has none, or a
        table of boxes is damaged.
    """
    files = [file for file in _find(sources) if file.group.split("/")[0] != BOXED]
    for name, vehicle in CLASSES.items():
        if not any(file.vehicle is vehicle for file in files):
            where = ", ".join(map(str, sources))
            raise DataError(
                f"{where}: no patches of the class {name}; expected pictures in {name}/<group>/ "
                "inside a folder or zip file"
            )
    return files


def find_boxed(sources: Sequence[Path]) -> list[PatchFile]:
    """List the patches of `boxes/`, in the same order; of each, `sides` is known.

    Raises
    ------
    DataError
        As `find_patches`, but for classes without patches.
    """
    return [file for file in _find(sources) if file.group.split("/")[0] == BOXED]


def _find(sources: Sequence[Path]) -> list[PatchFile]:
    files = [file for source in dict.fromkeys(sources) for file in _find_in(source)]
    return sorted(files, key=lambda file: (file.group, _numeric(file.name), file.source))


def _find_in(source: Path) -> list[PatchFile]:
    if source.is_dir():
        names = [path.relative_to(source).as_posix() for path in _files(source)]
    elif source.exists():
        names = _zip_names(source)
    else:
        raise DataError(f"{source}: no such folder or zip file")
    boxes = _read_table(source) if TABLE in names else {}
    top = source.resolve().name
    files = [file for name in names if (file := _patch_file(source, top, name, boxes))]
    if not files:
        raise DataError(
            f"{source}: no pictures in vehicles/<group>/ or non-vehicles/<group>/; "
            "see data/README.md for the layout"
        )
    return files


def _files(folder: Path) -> Iterator[Path]:
    """Give the files below a folder; no devices and pipes, which may have no end."""
    return (path for path in folder.rglob("*") if path.is_file())


def _zip_names(source: Path) -> list[str]:
    try:
        return list_members(source)
    except ArchiveError as error:
        raise DataError(f"{source}: {error}") from error


def _read_table(source: Path) -> dict[str, Sides]:
    """Return the sides of each patch that the source's table names."""
    with ExitStack() as stack:
        table = _read_bytes(source, TABLE, {}, stack)
    try:
        rows = list(csv.reader(io.StringIO(table.decode("utf-8"), newline="")))
        if not rows or tuple(rows[0]) != COLUMNS:
            raise ValueError(f"its first line is not {','.join(COLUMNS)}")
        return {name: _sides(values) for name, *values in rows[1:]}
    except (ValueError, csv.Error) as error:
        raise DataError(f"{source}: {TABLE} is damaged ({error}); mine it anew") from error


def _sides(values: Sequence[str]) -> Sides:
    left, top, right, bottom = (float(value) if value else None for value in values)
    if not all(side is None or math.isfinite(side) for side in (left, top, right, bottom)):
        raise ValueError("a side is not a number")
    return left, top, right, bottom


def _patch_file(source: Path, top: str, name: str, boxes: Mapping[str, Sides]) -> PatchFile | None:
    """Return the patch that a file name stands for, in a source named `top`; None if it is none."""
    path = PurePosixPath(name)
    hidden = any(part.startswith((".", "__MACOSX")) for part in path.parts)
    if hidden or path.suffix.lower() not in PICTURE_SUFFIXES:
        return None
    sides = boxes.get(name)
    known = CLASSES | ({BOXED: True} if sides else {})
    folders = [top, *path.parts[:-1]]
    for depth in range(len(folders) - 1, -1, -1):
        if folders[depth] in known:
            group = escaped("/".join(folders[depth:]))
            return PatchFile(source, name, group, known[folders[depth]], sides)
    return None


def _numeric(name: str) -> list[tuple[int, str]]:
    """Sort key in which image10 follows image9; a number may have any number of digits."""
    parts = re.split(r"0*([0-9]+)", name)
    return [(len(part) if part.isdecimal() else 0, part) for part in parts]


def read_patches(files: Iterable[PatchFile]) -> Iterator[Patch]:
    """Read patches in the order given; a broken one has no image. Each zip file is opened once."""
    with ExitStack() as stack:
        archives: dict[Path, zipfile.ZipFile] = {}
        for file in files:
            data = _read_bytes(file.source, file.name, archives, stack)
            yield Patch(file, decode_image(data), zlib.crc32(data))


def _read_bytes(
    source: Path, name: str, archives: dict[Path, zipfile.ZipFile], stack: ExitStack
) -> bytes:
    """Return what a file holds; nothing where it cannot be had."""
    try:
        if source.is_dir():
            return read_whole(source / name, most=MAX_PATCH_BYTES, what="patch", error=DataError)
        if source not in archives:
            archives[source] = stack.enter_context(open_archive(source))
        return read_member(archives[source], name, most=MAX_PATCH_BYTES)
    except (DataError, ArchiveError):
        return b""

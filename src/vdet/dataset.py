"""Labelled patches from folders or zip files, with the group that each belongs to.

The layout is the Udacity set's: `vehicles/<group>/*.png` and `non-vehicles/<group>/*.png`, in
folders, in zip files, or one class in each.
"""

import re
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from vdet.errors import DataError
from vdet.images import SUFFIXES, Image, decode_image
from vdet.untrusted import (
    ArchiveError,
    escaped,
    list_members,
    open_archive,
    printable,
    read_member,
    read_whole,
)

CLASSES = {"vehicles": True, "non-vehicles": False}
MAX_PATCH_BYTES = 16_000_000


@dataclass(frozen=True, slots=True)
class PatchFile:
    """Where a patch lies: in the zip file or folder `source`, under `name`."""

    source: Path
    name: str
    group: str
    """Class and folder, `vehicles/GTI_Far`; patches of one group may be near-duplicates."""
    vehicle: bool

    def __str__(self) -> str:
        return f"{self.source}: {printable(self.name)}"


@dataclass(frozen=True, slots=True)
class Patch:
    """A patch as read: BGR uint8 image of any size, None where it is broken, and its checksum."""

    file: PatchFile
    image: Image | None
    checksum: int


def find_patches(sources: Sequence[Path]) -> list[PatchFile]:
    """List the patches in folders and zip files, group by group, in numeric order of file names.

    Raises
    ------
    DataError
        A source cannot be read, holds no patch, or is a zip file with a name in it that is given
        twice, leads out of the archive or is a symbolic link; or one of the two classes has none.
    """
    files = [file for source in dict.fromkeys(sources) for file in _find_in(source)]
    for name, vehicle in CLASSES.items():
        if not any(file.vehicle is vehicle for file in files):
            where = ", ".join(map(str, sources))
            raise DataError(
                f"{where}: no patches of the class {name}; expected pictures in {name}/<group>/ "
                "inside a folder or zip file"
            )
    return sorted(files, key=lambda file: (file.group, _numeric(file.name), file.source))


def _find_in(source: Path) -> list[PatchFile]:
    if source.is_dir():
        names = [path.relative_to(source).as_posix() for path in _files(source)]
    elif source.exists():
        names = _zip_names(source)
    else:
        raise DataError(f"{source}: no such folder or zip file")
    files = [file for name in names if (file := _patch_file(source, name))]
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


def _patch_file(source: Path, name: str) -> PatchFile | None:
    """Return the patch that a file name stands for; None for what is no patch."""
    path = PurePosixPath(name)
    hidden = any(part.startswith((".", "__MACOSX")) for part in path.parts)
    if hidden or path.suffix.lower() not in SUFFIXES:
        return None
    folders = [source.resolve().name, *path.parts[:-1]]
    for depth in range(len(folders) - 1, -1, -1):
        if folders[depth] in CLASSES:
            group = escaped("/".join(folders[depth:]))
            return PatchFile(source, name, group, CLASSES[folders[depth]])
    return None


def _numeric(name: str) -> list[tuple[int, str]]:
    """Sort key in which image10 follows image9; a number may have any number of digits."""
    parts = re.split(r"0*([0-9]+)", name)
    return [(len(part) if part.isdecimal() else 0, part) for part in parts]


def read_patches(files: Iterable[PatchFile]) -> Iterator[Patch]:
    """Read patches in the order given; a broken one has no image. Each zip file is opened once."""
    archives: dict[Path, zipfile.ZipFile] = {}
    try:
        for file in files:
            data = _read_bytes(file, archives)
            yield Patch(file, decode_image(data), zlib.crc32(data))
    finally:
        for archive in archives.values():
            archive.close()


def _read_bytes(file: PatchFile, archives: dict[Path, zipfile.ZipFile]) -> bytes:
    """Return the encoded picture; nothing where it cannot be had."""
    try:
        if file.source.is_dir():
            path = file.source / file.name
            return read_whole(path, most=MAX_PATCH_BYTES, what="patch", error=DataError)
        if file.source not in archives:
            archives[file.source] = open_archive(file.source)
        return read_member(archives[file.source], file.name, most=MAX_PATCH_BYTES)
    except (DataError, ArchiveError):
        return b""

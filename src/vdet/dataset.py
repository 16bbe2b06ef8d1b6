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
        return f"{self.source}: {self.name}"


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
        A source cannot be read or holds no patch, or one of the two classes has none.
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
        names = [path.relative_to(source).as_posix() for path in source.rglob("*")]
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


def _zip_names(source: Path) -> list[str]:
    try:
        with zipfile.ZipFile(source) as archive:
            return [info.filename for info in archive.infolist() if not info.is_dir()]
    except (OSError, zipfile.BadZipFile, NotImplementedError, ValueError) as error:
        raise DataError(f"{source}: is neither a folder nor a readable zip file") from error


def _patch_file(source: Path, name: str) -> PatchFile | None:
    """Return the patch that a file name stands for; None for what is no patch."""
    path = PurePosixPath(name)
    hidden = any(part.startswith((".", "__MACOSX")) for part in path.parts)
    if hidden or path.suffix.lower() not in SUFFIXES:
        return None
    folders = [source.resolve().name, *path.parts[:-1]]
    for depth in range(len(folders) - 1, -1, -1):
        if folders[depth] in CLASSES:
            group = "/".join(folders[depth:])
            return PatchFile(source, name, group, CLASSES[folders[depth]])
    return None


def _numeric(name: str) -> list[tuple[int, str]]:
    """Sort key in which image10 follows image9."""
    return [(int(part), "") if part.isdecimal() else (0, part) for part in re.split(r"(\d+)", name)]


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
            return (file.source / file.name).read_bytes()
        if file.source not in archives:
            archives[file.source] = zipfile.ZipFile(file.source)
        info = archives[file.source].getinfo(file.name)
        return archives[file.source].read(info) if info.file_size <= MAX_PATCH_BYTES else b""
    except Exception:  # zipfile raises a dozen kinds on damaged, encrypted and foreign members
        return b""

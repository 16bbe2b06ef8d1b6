"""Zip files, read with limits, so that a malicious one can do no harm."""

import stat
import zipfile
from collections.abc import Mapping
from pathlib import Path, PurePath, PurePosixPath, PureWindowsPath
from typing import IO

from vdet.errors import printable
from vdet.files import record_input

_COMPRESSIONS = frozenset({zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED})
"""Methods that can be unpacked up to a limit; zipfile unpacks the others as a whole."""
_ENCRYPTED = 1  # bit of a member's flags


class ArchiveError(ValueError):
    """A zip file, or a member of it, is rejected; the message says why."""


def open_archive(file: Path | IO[bytes]) -> zipfile.ZipFile:
    """Open a zip file to read it, and record it as an input. Raises `ArchiveError`."""
    if isinstance(file, Path):
        record_input(file)
    try:
        return zipfile.ZipFile(file)
    except Exception as error:  # zipfile raises a dozen kinds on damaged data
        raise ArchiveError("is not a folder or a readable zip file") from error


def store(archive: zipfile.ZipFile, name: str, data: str | bytes) -> None:
    """Write a member without time and system, so that the same data give the same file."""
    info = zipfile.ZipInfo(name)  # of the earliest time
    info.compress_type = archive.compression
    info.create_system = 3  # Unix; the default depends on the system
    info.external_attr = 0o644 << 16
    archive.writestr(info, data)


def is_hidden(name: PurePath) -> bool:
    """Return whether a name is that of a hidden file, or one that macOS adds to zip files."""
    return any(part.startswith((".", "__MACOSX")) for part in name.parts)


def list_members(file: Path | IO[bytes]) -> list[str]:
    """Return the names of the files in a zip file that are not hidden.

    Raises
    ------
    ArchiveError
        It is not a zip file or is damaged, a name occurs twice or leads out of the archive's
        folder, or a member is a symbolic link.
    """
    with open_archive(file) as archive:
        members = [member for member in archive.infolist() if not member.is_dir()]
    names: dict[str, None] = {}
    for member in members:
        if mistake := _mistake(member, names):
            raise ArchiveError(f"its member {printable(member.filename)} {mistake}")
        names[member.filename] = None
    return [name for name in names if not is_hidden(PurePosixPath(name))]


def _mistake(member: zipfile.ZipInfo, earlier: Mapping[str, None]) -> str | None:
    posix, windows = PurePosixPath(member.filename), PureWindowsPath(member.filename)
    if posix.is_absolute() or windows.drive or windows.root:
        return "has an absolute name; create the archive again with relative names"
    if ".." in windows.parts:
        return "has '..' in its name; create the archive again with relative names"
    if stat.S_ISLNK(member.external_attr >> 16):
        return "is a symbolic link; put the file itself in its place"
    if member.filename in earlier:
        return "occurs twice; keep one"
    return None


def read_member(archive: zipfile.ZipFile, name: str, *, limit: int) -> bytes:
    """Return a member's content, checksum verified; never unpack more than its stated size.

    Raises
    ------
    ArchiveError
        There is no such member, it is larger than `limit`, encrypted, compressed in another
        way than `ZIP_DEFLATED`, or damaged.
    """
    try:
        member = archive.getinfo(name)
        if member.file_size > limit:
            raise ArchiveError(f"its member {name} is larger than {limit:,} bytes")
        if member.flag_bits & _ENCRYPTED:
            raise ArchiveError(f"its member {name} is encrypted")
        if member.compress_type not in _COMPRESSIONS:
            raise ArchiveError(f"its member {name} is compressed in an unusual way")
        with archive.open(member) as file:
            return file.read(member.file_size)  # not read(), which unpacks everything first
    except ArchiveError:
        raise
    except Exception as error:  # zipfile and zlib raise a dozen kinds on damaged data
        raise ArchiveError(f"its member {name} is damaged or missing") from error

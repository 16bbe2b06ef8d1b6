"""Zip files from outside: listed and read, but never more of them than there should be."""

import stat
import zipfile
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import IO

from vdet.files import printable

_COMPRESSIONS = frozenset({zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED})
"""Those that can be unpacked up to a limit; zipfile unpacks the others in one go."""
_ENCRYPTED = 1  # bit of a member's flags


class ArchiveError(ValueError):
    """A zip file, or a member of it, that is not read; the message says why."""


def open_archive(file: Path | IO[bytes]) -> zipfile.ZipFile:
    """Open a zip file to read it. Raises `ArchiveError`."""
    try:
        return zipfile.ZipFile(file)
    except Exception as error:  # zipfile raises a dozen kinds on damaged data
        raise ArchiveError("is neither a folder nor a readable zip file") from error


def list_members(path: Path) -> list[str]:
    """Return the names of the files in a zip file.

    Raises
    ------
    ArchiveError
        It is not a zip file or is damaged, or a name is there twice, leads out of a folder that
        the archive would be unpacked in, or is that of a symbolic link.
    """
    with open_archive(path) as archive:
        members = [member for member in archive.infolist() if not member.is_dir()]
    names: set[str] = set()
    for member in members:
        if complaint := _complaint(member, names):
            raise ArchiveError(f"its member {printable(member.filename)} {complaint}")
        names.add(member.filename)
    return [member.filename for member in members]


def _complaint(member: zipfile.ZipInfo, earlier: set[str]) -> str | None:
    posix, windows = PurePosixPath(member.filename), PureWindowsPath(member.filename)
    if posix.is_absolute() or windows.drive or windows.root:
        return "has an absolute name; make the archive anew, with names from its top folder on"
    if ".." in windows.parts:
        return "has '..' in its name; make the archive anew, with names from its top folder on"
    if stat.S_ISLNK(member.external_attr >> 16):
        return "is a symbolic link; put the file itself in its place"
    if member.filename in earlier:
        return "is in it twice; keep one"
    return None


def read_member(archive: zipfile.ZipFile, name: str, *, most: int) -> bytes:
    """Return a member's content, its checksum compared; no more is unpacked than it claims to be.

    Raises
    ------
    ArchiveError
        There is no such member, it is larger than `most` bytes, encrypted, compressed in another
        way than `ZIP_DEFLATED`, or damaged.
    """
    try:
        member = archive.getinfo(name)
        if member.file_size > most:
            raise ArchiveError(f"its member {name} is larger than {most:,} bytes")
        if member.flag_bits & _ENCRYPTED:
            raise ArchiveError(f"its member {name} is encrypted")
        if member.compress_type not in _COMPRESSIONS:
            raise ArchiveError(f"its member {name} is compressed in an unusual way")
        with archive.open(member) as file:
            return file.read(member.file_size)  # not read(): that unpacks before it counts
    except ArchiveError:
        raise
    except Exception as error:  # zipfile and zlib raise a dozen kinds on damaged data
        raise ArchiveError(f"its member {name} is damaged or missing") from error

"""Temporary folders, into which outputs are written before they appear.

A temporary folder lies in the folder of the outputs and is named `.vdet-`, the host, and 16 digits.
The writer holds a lock on it, which the system releases when the process ends, in whatever way. A
lock of another host may not be seen on a shared file system, so what a killed run left is removed
by the next run on its host.
"""

import contextlib
import os
import platform
import re
import shutil
from pathlib import Path

from vdet.errors import UnsupportedSystemError

try:
    import fcntl
except ImportError as error:
    raise UnsupportedSystemError("files cannot be locked here; on Windows, use WSL") from error

_HOST = re.sub(r"[^a-z0-9]", "", platform.node().lower())[:16]
_NAME = re.compile(rf"\.vdet-{_HOST}-[0-9a-f]{{16}}")
_FOLDER_FLAGS = os.O_RDONLY | os.O_NOFOLLOW | os.O_DIRECTORY


def create_folder(parent: Path, cleanup: contextlib.ExitStack) -> Path:
    """Make an empty folder in `parent` and return it; `cleanup` unlocks and removes it."""
    while True:
        candidate = parent / f".vdet-{_HOST}-{os.urandom(8).hex()}"
        # An interrupt may come as soon as the folder is there.
        cleanup.callback(shutil.rmtree, candidate, ignore_errors=True)
        candidate.mkdir(0o700)  # what is private stays so while it is written
        with contextlib.suppress(FileNotFoundError):  # another run took it for stale
            descriptor = os.open(candidate, _FOLDER_FLAGS)
            cleanup.callback(os.close, descriptor)
            if try_to_lock(descriptor) and os.fstat(descriptor).st_nlink > 0:
                return candidate


def try_to_remove(path: Path) -> None:
    """Remove a file if it is there and can be removed."""
    with contextlib.suppress(OSError):
        path.unlink()


def remove_stale(folder: Path) -> None:
    """Remove the temporary folders in `folder` whose writers have ended."""
    with contextlib.suppress(OSError):
        with os.scandir(folder) as entries:  # names, not paths: there may be thousands
            names = [entry.name for entry in entries if _NAME.fullmatch(entry.name)]
        for name in names:
            with contextlib.suppress(OSError):
                _remove_if_stale(folder / name)


def _remove_if_stale(folder: Path) -> None:
    descriptor = os.open(folder, _FOLDER_FLAGS)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        shutil.rmtree(folder)
    finally:
        os.close(descriptor)


def try_to_lock(descriptor: int) -> bool:
    """Lock a file for this process until it is closed; return False if another has locked it.

    Without locks, as on some network disks, the answer is True.
    """
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True


def sync(path: Path) -> None:
    """Wait until the content of a file, however it was written, is on the disk."""
    descriptor = os.open(path, os.O_RDWR | os.O_NOFOLLOW)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)

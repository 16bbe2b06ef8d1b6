"""Temporary files and folders, which outputs are written into before they appear.

A temporary file lies beside its output and is named `.name.vdet-`, the host, 16 digits and the
suffix; a temporary folder lies in the folder that its files go into. The writer holds a lock on it,
which the system releases when the process ends, in whatever way. A lock of another host may not be
seen on a shared file system, so what a killed run left is removed by the next run on its host.
"""

import contextlib
import os
import platform
import re
import secrets
import shutil
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows: files are not locked, and none is taken for stale
    fcntl = None  # type: ignore[assignment]

_HOST = re.sub(r"[^a-z0-9]", "", platform.node().lower())[:16]
_NAME = re.compile(rf"\..*\.vdet-{_HOST}-[0-9a-f]{{16}}(\.[^.]*)?", re.DOTALL)
_MAX_STEM = 180  # bytes; a whole name may have 255
_NOT_A_LINK = getattr(os, "O_NOFOLLOW", 0)
_FLAGS = os.O_RDWR | _NOT_A_LINK | getattr(os, "O_BINARY", 0)
_FOLDER_FLAGS = os.O_RDONLY | _NOT_A_LINK | getattr(os, "O_DIRECTORY", 0)


def create_file(path: Path, cleanup: contextlib.ExitStack) -> Path:
    """Make an empty file beside `path` and return it; `cleanup` unlocks and removes it.

    It would also remove another file of that name, but no two get the same one.
    """
    while True:
        candidate = _candidate(path, path.parent)
        cleanup.callback(try_to_remove, candidate)  # an interrupt may come as soon as it is there
        if _hold(os.open(candidate, _FLAGS | os.O_CREAT | os.O_EXCL, 0o666), cleanup):
            return candidate


def create_folder(path: Path, cleanup: contextlib.ExitStack) -> Path:
    """Make an empty folder in the folder `path` and return it, as `create_file` does."""
    while True:
        candidate = _candidate(path, path)
        cleanup.callback(shutil.rmtree, candidate, ignore_errors=True)
        candidate.mkdir()
        if fcntl is None:
            return candidate
        with contextlib.suppress(FileNotFoundError):  # it was removed before it was opened
            if _hold(os.open(candidate, _FOLDER_FLAGS), cleanup):
                return candidate


def _hold(descriptor: int, cleanup: contextlib.ExitStack) -> bool:
    """Lock a new file or folder; return False if another run took it for stale before that."""
    cleanup.callback(os.close, descriptor)
    return try_to_lock(descriptor) and os.fstat(descriptor).st_nlink > 0


def _candidate(path: Path, folder: Path) -> Path:
    stem = os.fsencode(path.stem)[:_MAX_STEM].decode(errors="ignore")
    return folder / f".{stem}.vdet-{_HOST}-{secrets.token_hex(8)}{path.suffix}"


def try_to_remove(path: Path) -> None:
    """Remove a file if it is there and can be removed."""
    with contextlib.suppress(OSError):
        path.unlink()


def remove_stale(folder: Path) -> None:
    """Remove the temporary files and folders in `folder` whose writers have ended."""
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if fcntl and _NAME.fullmatch(entry.name):
                with contextlib.suppress(OSError):
                    _remove_if_stale(entry)


def _remove_if_stale(entry: "os.DirEntry[str]") -> None:
    is_folder = entry.is_dir(follow_symlinks=False)
    descriptor = os.open(entry.path, _FOLDER_FLAGS if is_folder else _FLAGS)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if is_folder:
            shutil.rmtree(entry.path)
        else:
            os.unlink(entry.path)  # noqa: PTH108
    finally:
        os.close(descriptor)


def try_to_lock(descriptor: int) -> bool:
    """Lock a file for this process until it is closed; return False if another has locked it.

    Without locks, as on some network disks, the answer is True.
    """
    if fcntl is None:
        return True
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True


def sync(path: Path) -> None:
    """Wait until the content of a file, however it was written, is on the disk."""
    descriptor = os.open(path, _FLAGS)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)

"""Temporary files beside their outputs, each known to be in use or forsaken.

Their names have one form, `.name.vdet-1a2b3c4d.suffix`, and whoever writes one holds a lock on it,
which the system takes away when the process ends, however it ends. So what a killed run left can be
told from what another run is writing at this moment, on other machines of a shared file system too.
"""

import contextlib
import os
import re
import secrets
from collections.abc import Iterator
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows: no lock is taken, and nothing is held for forsaken
    fcntl = None  # type: ignore[assignment]

_NAME = re.compile(r"\..*\.vdet-[0-9a-f]{8}(\.[^.]*)?", re.DOTALL)
_LONGEST_STEM = 200  # bytes; a whole name may have 255
_FLAGS = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)


@contextlib.contextmanager
def temporary_beside(path: Path) -> Iterator[Path]:
    """Give a new, empty file in the folder of `path`, of its suffix; what is left of it goes.

    Raises
    ------
    OSError
        The file cannot be made.
    """
    temporary, descriptor = _make(path)
    try:
        yield temporary
    finally:
        temporary.unlink(missing_ok=True)
        if descriptor is not None:
            os.close(descriptor)


def bring_to_disk(path: Path) -> None:
    """Wait until what was written to a file, by whatever means, has arrived. Raises `OSError`."""
    descriptor = os.open(path, _FLAGS)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def remove_forsaken(folder: Path) -> None:
    """Remove the temporary files in `folder` whose writers have ended."""
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if _NAME.fullmatch(entry.name):
                with contextlib.suppress(OSError):
                    _remove_if_forsaken(entry.path)


def _make(path: Path) -> tuple[Path, int | None]:
    """Return a new file, and the descriptor that holds its lock, where there are locks."""
    stem = os.fsencode(path.stem)[:_LONGEST_STEM].decode(errors="ignore")
    while True:
        candidate = path.with_name(f".{stem}.vdet-{secrets.token_hex(4)}{path.suffix}")
        descriptor = os.open(candidate, _FLAGS | os.O_CREAT | os.O_EXCL, 0o666)
        if fcntl is None:
            os.close(descriptor)
            return candidate, None
        # Somebody who was removing forsaken files may have come between the two calls.
        if _lock(descriptor) and os.fstat(descriptor).st_nlink:
            return candidate, descriptor
        os.close(descriptor)


def _remove_if_forsaken(path: str) -> None:
    if fcntl is None:
        return
    descriptor = os.open(path, _FLAGS)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.unlink(path)  # noqa: PTH108
    finally:
        os.close(descriptor)


def _lock(descriptor: int) -> bool:
    """Return False if another has the lock. Where files have no locks, none is forsaken either."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True

"""Signals and file locks that only some systems have; elsewhere, vdet runs without them."""

import contextlib
import os
import signal
from collections.abc import Iterator
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

_ENDING = ("SIGINT", "SIGTERM", "SIGHUP")
ENDING_SIGNALS = [signal.Signals[name] for name in _ENDING if hasattr(signal, name)]
"""The signals that end the program: of Ctrl-C, of `kill`, and of a terminal that closes."""


@contextlib.contextmanager
def blocked_interrupts() -> Iterator[None]:
    """Delay Ctrl-C to the end of the block; processes that start in the block never get it."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing.resource_tracker import ensure_running

    ensure_running()  # if it started in the block, it would unblock signals
    earlier = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, earlier)


def lock(descriptor: int) -> bool:
    """Lock a file for this process until it is closed.

    Returns False where files have no locks: on some systems, and on some network disks.

    Raises
    ------
    BlockingIOError
        Another process has locked it.
    """
    if fcntl is None:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError:
        return False
    return True


@contextlib.contextmanager
def locked_folder(folder: Path) -> Iterator[bool]:
    """Lock a folder for a `with` block; yield whether it is locked. Errors are those of `lock`."""
    if fcntl is None:
        yield False
        return
    descriptor = os.open(folder, os.O_RDONLY | os.O_NOFOLLOW | os.O_DIRECTORY)
    try:
        yield lock(descriptor)
    finally:
        os.close(descriptor)

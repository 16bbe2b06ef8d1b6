"""Signals and file locks of the system."""

import contextlib
import fcntl
import os
import signal
from collections.abc import Iterator
from pathlib import Path

ENDING_SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
"""The signals that end the program: of Ctrl-C, of `kill`, and of a terminal that closes."""


@contextlib.contextmanager
def blocked_interrupts() -> Iterator[None]:
    """Delay Ctrl-C to the end of the block; processes that start in the block never get it."""
    from multiprocessing.resource_tracker import ensure_running

    ensure_running()  # if it started in the block, it would unblock signals
    earlier = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, earlier)


def lock(descriptor: int) -> bool:
    """Lock a file for this process until it is closed.

    Returns False where files have no locks: on some network disks.

    Raises
    ------
    BlockingIOError
        Another process has locked it.
    """
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
    descriptor = os.open(folder, os.O_RDONLY | os.O_NOFOLLOW | os.O_DIRECTORY)
    try:
        yield lock(descriptor)
    finally:
        os.close(descriptor)

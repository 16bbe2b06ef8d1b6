"""Worker processes of this machine: they end in order on SIGTERM, and after their parent."""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from vdet.errors import INTERRUPTED

T = TypeVar("T")
R = TypeVar("R")

_LOOK_EVERY = 0.5  # seconds
_LONGEST = 5.0  # seconds that an end in order may take


@contextmanager
def ignore_sigint() -> Iterator[None]:
    """Start processes that Ctrl-C in a terminal does not reach: their parent ends them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def end_with(parent: int) -> None:
    """Watch, in a thread, whether the process `parent` is there; without it, end this one."""
    threading.Thread(target=_watch, args=(parent,), name="vdet-watch", daemon=True).start()


def work(function: Callable[[T], R], item: T) -> R:
    """Call `function`; on SIGTERM let it clean up, and end the process."""
    try:
        with _sigterm_interrupts():
            return function(item)
    except KeyboardInterrupt:
        os._exit(INTERRUPTED)


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_LOOK_EVERY)
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(_LONGEST)
    os._exit(INTERRUPTED)


@contextmanager
def _sigterm_interrupts() -> Iterator[None]:
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)

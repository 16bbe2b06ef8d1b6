"""The process of the program: signals, standard streams, and threads of the libraries."""

import gc
import os
import signal
import sys
import threading
import time
from typing import NoReturn

from vdet.errors import INTERRUPTED, VdetError, in_one_line
from vdet.system import CAN_WAKE, ENDING_SIGNALS
from vdet.workers import SINGLE_THREADED

CLEANUP_TIMEOUT = 10.0  # seconds between a signal and a forced exit
_SENT_AGAIN = 20
_NEW_OBJECTS = 20_000  # between two collections: what loading the libraries makes is no garbage
_STDOUT, _STDERR = 1, 2


def run() -> NoReturn:
    """Run the program and exit: see `vdet.cli.main`. SIGTERM and SIGHUP act like Ctrl-C."""
    open_streams()
    gc.set_threshold(_NEW_OBJECTS)
    for name, value in SINGLE_THREADED.items():
        os.environ.setdefault(name, value)
    # A killed worker leaves semaphores, which loky removes with a warning that users do not need.
    sys.warnoptions.append("ignore::UserWarning:joblib.externals.loky.backend.resource_tracker")
    for number in _signals():
        signal.signal(number, _interrupt)
    if CAN_WAKE:
        _watch_for_signals()
    try:
        from vdet.cli import main

        main()
    except KeyboardInterrupt:
        sys.stderr.write("vdet: interrupted\n")
        sys.exit(INTERRUPTED)
    except (ImportError, MemoryError) as error:  # as the libraries are loaded
        sys.stderr.write(f"vdet: {in_one_line(error)}\n")
        sys.exit(VdetError.exit_code)
    except SystemExit as end:
        _ignore_signals()  # the work is done: a late signal must not change the exit code
        _exit(end.code)


def open_streams() -> None:
    """Open closed standard streams, so that no output file gets their descriptors."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free number
            os.set_inheritable(number, True)
    sys.stdout = sys.stdout or open(_STDOUT, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stderr = sys.stderr or open(_STDERR, "w", encoding="utf-8", closefd=False)  # noqa: SIM115


def _signals() -> list[signal.Signals]:
    """Return the signals that end the program and are not ignored, as by `nohup`."""
    return [number for number in ENDING_SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]


def _ignore_signals() -> None:
    for number in _signals():
        signal.signal(number, signal.SIG_IGN)


def _interrupt(*_: object) -> NoReturn:
    _ignore_signals()  # a second signal must not interrupt the clean-up
    raise KeyboardInterrupt


def _watch_for_signals() -> None:
    """Exit `CLEANUP_TIMEOUT` after a signal, even if the main thread hangs in a library.

    A signal just before the main thread begins to wait does not end that wait, so it is sent again;
    once handled, it is ignored.
    """
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer)  # gets the number of a signal at once
    numbers, thread = _signals(), threading.get_ident()

    def exit_late() -> None:
        while (number := os.read(reader, 1)[0]) not in numbers:
            pass
        for _ in range(_SENT_AGAIN):
            time.sleep(CLEANUP_TIMEOUT / _SENT_AGAIN)
            signal.pthread_kill(thread, number)
        os._exit(INTERRUPTED)

    threading.Thread(target=exit_late, daemon=True).start()


def _exit(code: object) -> NoReturn:
    """Exit without unloading the libraries, which takes time and waits for hanging threads."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code if isinstance(code, int) else int(code is not None))

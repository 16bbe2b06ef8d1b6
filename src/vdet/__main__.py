"""The program as a process, also for `python -m vdet`: signals, standard streams, threads."""

import gc
import os
import signal
import sys
from typing import NoReturn

from vdet.errors import INTERRUPTED, VdetError, in_one_line
from vdet.files import ENDING_SIGNALS
from vdet.workers import SINGLE_THREADED

CLEANUP_TIMEOUT = 10  # seconds between a signal and a forced exit
_NEW_OBJECTS = 20_000  # between two collections: what loading the libraries makes is no garbage
_STDOUT, _STDERR = 1, 2


def main() -> NoReturn:
    """Run the program and exit: see `vdet.cli.main`. SIGTERM and SIGHUP act like Ctrl-C."""
    open_streams()
    gc.set_threshold(_NEW_OBJECTS)
    for name, value in SINGLE_THREADED.items():
        os.environ.setdefault(name, value)
    os.environ["PYTHONSAFEPATH"] = "1"  # workers import nothing from the current folder
    # A killed worker leaves semaphores, which loky removes with a warning that users do not need.
    sys.warnoptions.append("ignore::UserWarning:joblib.externals.loky.backend.resource_tracker")
    for number in ENDING_SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as with `nohup`
            signal.signal(number, _interrupt)
    try:
        from vdet import cli

        code = cli.main()
    except KeyboardInterrupt:
        sys.stderr.write("vdet: interrupted\n")
        sys.exit(INTERRUPTED)
    except (ImportError, MemoryError) as error:  # as the libraries are loaded
        sys.stderr.write(f"vdet: {in_one_line(error)}\n")
        sys.exit(VdetError.exit_code)
    _ignore_signals()  # the work is done: a late signal must not change the exit code
    _exit(code)


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


def _interrupt(*_: object) -> NoReturn:
    _ignore_signals()  # a second signal must not interrupt the clean-up
    signal.alarm(CLEANUP_TIMEOUT)  # ends the process even if a thread hangs in a library
    raise KeyboardInterrupt


def _ignore_signals() -> None:
    for number in ENDING_SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def _exit(code: int) -> NoReturn:
    """Exit without unloading the libraries, which takes time and waits for hanging threads."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


if __name__ == "__main__":
    main()

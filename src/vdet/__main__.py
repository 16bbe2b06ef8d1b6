"""Process entry point: signals end the program in order, also while its modules are loaded."""

import os
import signal
import sys
import threading
from typing import NoReturn

from vdet.errors import INTERRUPTED

SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")
CLEANUP_TIMEOUT = 10.0  # seconds between a signal and a forced exit


def main() -> NoReturn:
    """Run the program and exit: see `vdet.cli.main`. SIGTERM and SIGHUP act like Ctrl-C."""
    for number in _signals():
        signal.signal(number, _interrupt)
    try:
        from vdet.cli import main as run

        run()
    except KeyboardInterrupt:
        sys.stderr.write("vdet: interrupted\n")
        sys.exit(INTERRUPTED)
    except SystemExit as end:
        _exit_if_a_thread_hangs(end.code)
        raise


def _signals() -> list[signal.Signals]:
    """Return those of `SIGNALS` that this system has and that are not ignored, as by `nohup`."""
    numbers = [signal.Signals[name] for name in SIGNALS if name in signal.Signals.__members__]
    return [number for number in numbers if signal.getsignal(number) is not signal.SIG_IGN]


def _interrupt(*_: object) -> NoReturn:
    for number in _signals():
        signal.signal(number, signal.SIG_IGN)  # a second signal must not interrupt the clean-up
    forced_exit = threading.Timer(CLEANUP_TIMEOUT, os._exit, (INTERRUPTED,))
    forced_exit.daemon = True
    forced_exit.start()
    raise KeyboardInterrupt


def _exit_if_a_thread_hangs(code: object) -> None:
    """Exit at once if a thread hangs in a read or write; unloading its libraries could crash it."""
    if any(thread.daemon and thread.name.startswith("vdet-") for thread in threading.enumerate()):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code if isinstance(code, int) else 1)


if __name__ == "__main__":
    main()

"""The door of the program: from here on a signal ends it in order, while it is loaded too."""

import os
import signal
import sys
import threading
from typing import NoReturn

from vdet.errors import INTERRUPTED

_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")
_LONGEST = 5.0  # seconds that an end in order may take


def main() -> NoReturn:
    """Run the program and exit: see `vdet.cli.main`. SIGTERM and SIGHUP are taken as Ctrl-C is."""
    for number in _heard():
        signal.signal(number, _interrupt)
    try:
        from vdet.cli import main as run

        run()
    except KeyboardInterrupt:
        sys.stderr.write("vdet: interrupted\n")
        sys.exit(INTERRUPTED)
    except SystemExit as end:
        _leave_what_hangs(end.code)
        raise


def _heard() -> list[signal.Signals]:
    """Return the signals of this system that nobody wants ignored, as `nohup` does."""
    numbers = [signal.Signals[name] for name in _SIGNALS if name in signal.Signals.__members__]
    return [number for number in numbers if signal.getsignal(number) is not signal.SIG_IGN]


def _interrupt(*_: object) -> NoReturn:
    for number in _heard():
        signal.signal(number, signal.SIG_IGN)  # cleaning up is not interrupted
    last = threading.Timer(_LONGEST, os._exit, (INTERRUPTED,))
    last.daemon = True
    last.start()
    raise KeyboardInterrupt


def _leave_what_hangs(code: object) -> None:
    """End at once if a thread hangs in a read or write: libraries do not unload under it."""
    if any(thread.daemon and thread.name.startswith("vdet-") for thread in threading.enumerate()):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code if isinstance(code, int) else 1)


if __name__ == "__main__":
    main()

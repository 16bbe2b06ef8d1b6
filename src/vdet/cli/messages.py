"""Standard error: lines, log records and progress bars that do not disturb one another."""

import logging
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vdet.errors import escaped
from vdet.files import output_errors
from vdet.progress import Advance, Steps, no_steps

if TYPE_CHECKING:
    from tqdm import tqdm

REFRESH_INTERVAL = 1.0  # seconds


def print_lines(*lines: str, err: bool = False) -> None:
    """Print each text as one line; a progress bar moves below them.

    Texts may have names of files in them: a name could forge a line, or control the terminal.

    Raises
    ------
    BrokenPipeError
        Whoever read the stream has ended.
    OutputError
        It cannot be written for another reason.
    """
    name = Path("standard error" if err else "standard output")
    bars = sys.modules.get("tqdm")  # imported where there is a bar
    with bars.tqdm.external_write_mode() if bars else nullcontext(), output_errors(name):
        click.echo("\n".join(map(escaped, lines)), err=err)


def is_quiet() -> bool:
    """Return whether the running command was given `--quiet`."""
    context = click.get_current_context(silent=True)
    return bool(context and context.obj)


def announce(*lines: str) -> None:
    """Print lines on standard error, but not with `--quiet`."""
    if lines and not is_quiet():
        print_lines(*lines, err=True)


class _LogHandler(logging.Handler):
    """Prints log records as messages, with the level of warnings and errors."""

    def emit(self, record: logging.LogRecord) -> None:
        level = "" if record.levelno < logging.WARNING else f"{record.levelname.lower()}: "
        print_lines(f"vdet: {level}{record.getMessage()}", err=True)


def set_up_logs(*, verbose: bool, quiet: bool) -> None:
    """Print the log records of vdet: warnings and errors, with `verbose` all, else errors."""
    log = logging.getLogger("vdet")
    log.handlers = [_LogHandler()]
    log.propagate = False
    log.setLevel(logging.ERROR if quiet else logging.DEBUG if verbose else logging.WARNING)
    # What Pillow says of damaged pictures is for developers.
    logging.getLogger("PIL").addHandler(logging.NullHandler())
    warnings.filterwarnings("ignore", module="PIL")


def _shows_bars() -> bool:
    return not is_quiet() and sys.stderr.isatty()


@contextmanager
def progress_steps(unit: str) -> Iterator[Steps]:
    """Yield a function that ends the bar of the step before and starts one.

    It takes the name of the step and its total. A step that has a name and no total shows how long
    it has taken, and disappears at its end. See `live_bar` for where there is no bar.
    """
    if not _shows_bars():
        yield no_steps
        return
    with ExitStack() as stack:

        def start(what: str, total: int | None) -> Advance:
            stack.close()
            timed = total is None and bool(what)
            form = "{desc} [{elapsed}]" if timed else None
            bar = live_bar(total=total, desc=what, unit=unit, leave=not timed, bar_format=form)
            return stack.enter_context(bar).update

        yield start


@contextmanager
def live_bar(**options: Any) -> "Iterator[tqdm[Any]]":
    """Give a bar that is drawn at least every `REFRESH_INTERVAL`: the program is at work.

    There is no bar with `--quiet`, and where standard error is not a terminal: its `disable` is
    then true.
    """
    from tqdm import tqdm

    ended = threading.Event()
    with tqdm(disable=not _shows_bars(), dynamic_ncols=True, **options) as bar:

        def repeat() -> None:
            while not ended.wait(REFRESH_INTERVAL):
                bar.refresh()

        if bar.disable:
            yield bar
            return
        thread = threading.Thread(target=repeat, name="vdet-progress", daemon=True)
        thread.start()
        try:
            yield bar
        finally:
            ended.set()
            thread.join()

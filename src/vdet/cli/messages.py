"""Messages: lines, log records and progress bars that do not garble one another."""

import logging
import sys
import warnings
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vdet.errors import escaped
from vdet.files import output_errors
from vdet.progress import Advance, Progress, no_progress

if TYPE_CHECKING:
    from tqdm import tqdm

    from vdet.findings import Finding

LOG = logging.getLogger("vdet")


def print_lines(*lines: str, err: bool = False) -> None:
    """Print each text as one line, above any progress bar.

    Texts are escaped: a file name in them could forge a line, or control the terminal.

    Raises
    ------
    BrokenPipeError
        The reader of the stream has ended.
    OutputError
        It cannot be written for another reason.
    """
    name = Path("standard error" if err else "standard output")
    bars = sys.modules.get("tqdm")  # imported if there is a bar
    with bars.tqdm.external_write_mode() if bars else nullcontext(), output_errors(name):
        click.echo("\n".join(map(escaped, lines)), err=err)


def is_quiet() -> bool:
    """Return whether `--quiet` is set: only errors are logged."""
    return LOG.level >= logging.ERROR


def announce(*lines: str) -> None:
    """Print lines on standard error, unless `--quiet` is set."""
    if lines and not is_quiet():
        print_lines(*lines, err=True)


def announce_notes(name: "Path | str", findings: "Iterable[Finding]") -> None:
    """Print the notes about lines, and that nothing was found, among the findings about a file."""
    codes = "line", "nothing-found"
    notes = (item for item in findings if item.severity == "note" and item.code in codes)
    announce(*(f"vdet: note: {name}: {note}" for note in notes))


class _LogHandler(logging.Handler):
    """Prints log records as messages; warnings are marked."""

    def emit(self, record: logging.LogRecord) -> None:
        mark = "warning: " if record.levelno == logging.WARNING else ""
        print_lines(f"vdet: {mark}{record.getMessage()}", err=True)


def set_up_logs() -> None:
    """Print the warnings and errors that vdet logs; `--quiet` and `--verbose` change the level."""
    LOG.handlers = [_LogHandler()]
    LOG.propagate = False
    LOG.setLevel(logging.WARNING)
    # Messages of Pillow about damaged images are for developers.
    logging.getLogger("PIL").addHandler(logging.NullHandler())
    warnings.filterwarnings("ignore", module="PIL")


def _shows_bars() -> bool:
    return not is_quiet() and sys.stderr.isatty()


def progress_bar(**options: Any) -> "tqdm[Any]":
    """Return a bar, disabled with `--quiet`, or if standard error is not a terminal."""
    from tqdm import tqdm

    return tqdm(disable=not _shows_bars(), dynamic_ncols=True, **options)


@contextmanager
def progress_bars(unit: str) -> Iterator[Progress]:
    """Yield a function that ends the bar of the previous step and starts a new one.

    It takes the name of the step and its total. A step with a name and no total shows only its
    name, and disappears at its end. See `progress_bar` for when there is no bar.
    """
    if not _shows_bars():
        yield no_progress  # without tqdm
        return
    with ExitStack() as stack:

        def start(step: str, total: int | None) -> Advance:
            stack.close()
            is_named_only = total is None and bool(step)
            form = "{desc} …" if is_named_only else None
            bar = progress_bar(
                total=total, desc=step, unit=unit, leave=not is_named_only, bar_format=form
            )
            return stack.enter_context(bar).update

        yield start

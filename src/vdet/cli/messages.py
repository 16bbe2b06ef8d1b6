"""Standard error: lines, log records and progress bars that do not disturb one another."""

import logging
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

import click
from tqdm import tqdm

from vdet.files import escaped
from vdet.pipeline.loop import Advance, Progress

if TYPE_CHECKING:
    from vdet.learn.network.training import TrainingState


def print_lines(*lines: str, err: bool = False) -> None:
    """Print each text as one line.

    Texts may have names of files in them: a name could forge a line, or control the terminal.
    """
    click.echo("\n".join(map(escaped, lines)), err=err)


def print_message(line: str) -> None:
    """Print a line on standard error; a progress bar moves below it."""
    with tqdm.external_write_mode():
        print_lines(line, err=True)


def counted(number: int | None, noun: str) -> str:
    """Write a number with its noun: 1 file, 2 files."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


class _LogHandler(logging.Handler):
    """Prints log records as messages, with the level of warnings and errors."""

    def emit(self, record: logging.LogRecord) -> None:
        level = "" if record.levelno < logging.WARNING else f"{record.levelname.lower()}: "
        print_message(f"vdet: {level}{record.getMessage()}")


def set_up_logs(*, verbose: bool, quiet: bool) -> None:
    """Print the log records of vdet: warnings and errors, with `verbose` all, else errors."""
    log = logging.getLogger("vdet")
    log.handlers = [_LogHandler()]
    log.propagate = False
    log.setLevel(logging.ERROR if quiet else logging.DEBUG if verbose else logging.WARNING)


@contextmanager
def progress_bar(unit: str, *, quiet: bool) -> Iterator[Progress]:
    """Give a function that starts a bar; see `vdet.pipeline.loop.run_video`.

    There is no bar where standard error is no terminal.
    """
    with ExitStack() as stack:

        def start(total: int | None) -> Advance:
            bar = tqdm(total=total, unit=unit, disable=_disable(quiet), dynamic_ncols=True)
            return stack.enter_context(bar).update

        yield start


@contextmanager
def files_bar(total: int, *, quiet: bool) -> Iterator[Callable[[int], None]]:
    """Give a function that counts a finished file and its frames; the bar shows frames/s."""
    began = time.perf_counter()
    frames = 0
    with tqdm(total=total, unit=" files", disable=_disable(quiet), dynamic_ncols=True) as bar:

        def advance(frames_of_file: int) -> None:
            nonlocal frames
            frames += frames_of_file
            rate = frames / (time.perf_counter() - began)
            bar.set_postfix_str(f"{rate:.1f} frames/s", refresh=False)
            bar.update()

        yield advance


@contextmanager
def steps_bar(total: int, *, quiet: bool) -> Iterator[Callable[["TrainingState"], None]]:
    """Give a function that shows how far a training is, its loss and its learning rate."""
    with tqdm(total=total, unit=" steps", disable=_disable(quiet), dynamic_ncols=True) as bar:

        def advance(state: "TrainingState") -> None:
            if bar.n == 0:  # a training that goes on is not as fast as its first step seems
                bar.initial = state.step - 1
            bar.set_postfix_str(f"loss {state.loss:.3f}, rate {state.rate:.1e}", refresh=False)
            bar.update(state.step - bar.n)

        yield advance


def _disable(quiet: bool) -> bool | None:
    return True if quiet else None  # None: unless standard error is a terminal

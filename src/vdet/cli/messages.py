"""Standard error: lines, log records and progress bars that do not disturb one another."""

import logging
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from tqdm import tqdm

from vdet.batch.progress import FrameCounts, batch_state, frame_counts
from vdet.files import escaped, output_errors
from vdet.progress import Advance, Progress, Steps

if TYPE_CHECKING:
    from vdet.learn.net.training import TrainingState


REFRESH_INTERVAL = 1.0  # seconds
_BATCH_FORMAT = "{percentage:3.0f}%|{bar:10}| {n_fmt}/{total_fmt} frames [{elapsed}{postfix}]"


def print_lines(*lines: str, err: bool = False) -> None:
    """Print each text as one line.

    Texts may have names of files in them: a name could forge a line, or control the terminal.

    Raises
    ------
    BrokenPipeError
        Whoever read the stream has ended.
    OutputError
        It cannot be written for another reason.
    """
    with output_errors(Path("standard error" if err else "standard output")):
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
    # What Pillow says of damaged pictures is for developers.
    logging.getLogger("PIL").addHandler(logging.NullHandler())
    warnings.filterwarnings("ignore", module="PIL")


@contextmanager
def progress_bar(unit: str, *, quiet: bool) -> Iterator[Progress]:
    """Give a function that starts a bar; see `vdet.run.video.run_video`.

    There is no bar where standard error is no terminal.
    """
    with progress_steps(unit, quiet=quiet) as start:
        yield lambda total: start("", total)


@contextmanager
def progress_steps(unit: str, *, quiet: bool) -> Iterator[Steps]:
    """Give a function that ends the bar of the step before and starts one with a name.

    A step without a total shows how long it has taken, and disappears at its end.
    """
    with ExitStack() as stack:

        def start(what: str, total: int | None) -> Advance:
            stack.close()
            timed = total is None and bool(what)
            bar = tqdm(
                total=total,
                desc=what or None,
                unit=unit,
                disable=_disable(quiet),
                dynamic_ncols=True,
                leave=not timed,
                bar_format="{desc} [{elapsed}]" if timed else None,
            )
            stack.enter_context(bar)
            if not bar.disable:  # shows that the program is at work while nothing advances
                stack.enter_context(_repeated(bar.refresh))
            return bar.update

        yield start


@contextmanager
def _repeated(call: Callable[[], object]) -> Iterator[None]:
    """Call a function in a thread, every `REFRESH_INTERVAL`."""
    ended = threading.Event()

    def repeat() -> None:
        while not ended.wait(REFRESH_INTERVAL):
            call()

    thread = threading.Thread(target=repeat, name="vdet-progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@contextmanager
def batch_bar(
    sources: Sequence[Path], *, by_size: bool, quiet: bool
) -> Iterator[FrameCounts | None]:
    """Give counts of frames to a batch of files, and show them in a bar with the running files.

    Gives None where there is no bar, or no temporary file for the counts can be made.

    Parameters
    ----------
    by_size
        Whether to guess the frames of files that are not begun from their sizes in bytes.
    """
    with ExitStack() as stack:
        bar = tqdm(disable=_disable(quiet), dynamic_ncols=True, bar_format=_BATCH_FORMAT)
        stack.enter_context(bar)
        counts = None
        if not bar.disable:
            with suppress(OSError):
                counts = stack.enter_context(frame_counts(len(sources)))
        if counts is not None:
            sizes = [_size(path) if by_size else 1.0 for path in sources]
            show = partial(_show_batch, bar, counts, sources, sizes, time.time())
            stack.callback(show)
            stack.enter_context(_repeated(show))
        yield counts


def _size(path: Path) -> float:
    try:
        return float(path.stat().st_size)
    except OSError:
        return 0.0


def _show_batch(
    bar: "tqdm[Any]",
    counts: FrameCounts,
    sources: Sequence[Path],
    sizes: Sequence[float],
    began: float,
) -> None:
    now = time.time()
    state = batch_state(counts.rows(), sizes, began, now)
    parts = [f"{state.done / max(now - began, 1e-3):.0f} frames/s"]
    if state.seconds_left is not None:
        parts.insert(0, f"{tqdm.format_interval(state.seconds_left)} left")
    parts.append(f"{state.ended} of {counted(len(sources), 'file')}")
    parts += [f"{escaped(sources[n].name)} {share:.0%}" for n, share in state.running]
    bar.n, bar.total = state.done, state.total
    bar.set_postfix_str(", ".join(parts))


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

"""Progress bars on standard error, where a person may be looking."""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

import click
from tqdm import tqdm

Advance = Callable[[int], object]


@contextmanager
def progress_bar(unit: str, *, quiet: bool) -> Iterator[Callable[[int | None], Advance]]:
    """Give a function that starts a bar of a total (None: unknown) and returns its advance.

    There is no bar where nobody would see it.
    """
    disable = True if quiet else None  # None: unless standard error is a terminal
    with ExitStack() as stack:

        def start(total: int | None) -> Advance:
            bar = tqdm(total=total, unit=unit, disable=disable, dynamic_ncols=True)
            return stack.enter_context(bar).update

        yield start


@contextmanager
def files_bar(total: int, *, quiet: bool) -> Iterator[Advance]:
    """Give a function that counts a file, told how many frames it had; the bar shows their rate."""
    began = time.perf_counter()
    frames = 0
    with tqdm(
        total=total, unit=" files", disable=True if quiet else None, dynamic_ncols=True
    ) as bar:

        def advance(more: int) -> None:
            nonlocal frames
            frames += more
            rate = frames / (time.perf_counter() - began)
            bar.set_postfix_str(f"{rate:.1f} frames/s", refresh=False)
            bar.update()

        yield advance


def tell(line: str) -> None:
    """Print a line on standard error that does not tear a bar."""
    with tqdm.external_write_mode():
        click.echo(line, err=True)

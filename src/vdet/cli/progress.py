"""Progress bars on standard error, where a person may be looking."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

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

"""How library code reports progress: it calls functions passed by the caller."""

import itertools
from collections.abc import Callable

Advance = Callable[[int], object]
"""Called with the number of items done since the last call."""

Progress = Callable[[str, int | None], Advance]
"""Called at the start of each stage of the work: its name, empty if there is only one, and the
expected number of items, None if it is unknown.
"""


def no_progress(_: str, __: int | None) -> Advance:
    """Show no progress."""
    return lambda _: None


def reporting(report: Callable[[int, int | None], object]) -> Progress:
    """Return a `Progress` that calls a function with the number of items done and the total."""

    def begin(_: str, total: int | None) -> Advance:
        done = itertools.count(1)
        return lambda count: [report(next(done), total) for _ in range(count)]

    return begin

"""How long the loop of a run waits for its threads: what limits the run."""

import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from operator import itemgetter
from typing import Literal, TypeVar, get_args

T = TypeVar("T")


Part = Literal["reading", "searching", "encoding"]
"""What the threads of a run do; the loop itself tracks and draws."""


class Waits:
    """Seconds that the loop of a run has waited for each part."""

    def __init__(self) -> None:
        self.seconds: dict[Part, float] = dict.fromkeys(get_args(Part), 0.0)

    @contextmanager
    def on(self, part: Part) -> Iterator[None]:
        """Count the time of a block as waiting."""
        began = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[part] += time.perf_counter() - began

    def for_each(self, part: Part, items: Iterable[T]) -> Iterator[T]:
        """Give the items; the time until each is there counts as waiting."""
        rest = iter(items)
        while True:
            with self.on(part):
                try:
                    item = next(rest)
                except StopIteration:
                    return
            yield item

    def describe(self, total: float) -> str:
        """Say what took most of the `total` seconds of a run, and what took how long."""
        own = max(0.0, total - sum(self.seconds.values()))
        part, longest = max(self.seconds.items(), key=itemgetter(1))
        limit = part if longest > own else "tracking and drawing"
        waited = ", ".join(f"{seconds:.1f} s for {part}" for part, seconds in self.seconds.items())
        return (
            f"{limit} limited the run: in {total:.1f} s it waited {waited}; tracking and drawing "
            f"took {own:.1f} s"
        )

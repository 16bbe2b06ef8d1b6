"""Packets are read from a file in spite of read errors."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

import av
from av.container import InputContainer

from vdet.media.demux import packets


class Failing:
    """A container whose reads follow `script`: packets to yield, or errors to raise."""

    def __init__(self, *script: Any) -> None:
        self.script = iter(script)

    def demux(self, _streams: list[Any]) -> Iterator[Any]:
        for step in self.script:
            if isinstance(step, Exception):
                raise step
            yield step


def error() -> av.FFmpegError:
    return av.error.InvalidDataError(1, "damaged")


def read(*script: Any) -> tuple[list[Any], int]:
    errors: list[None] = []
    container = cast(InputContainer, Failing(*script))
    found = list(packets(container, on_error=lambda: errors.append(None)))
    return found, len(errors)


A, B = SimpleNamespace(size=10), SimpleNamespace(size=20)


def test_reading_goes_on_after_an_error() -> None:
    assert read(A, error(), B) == ([A, B], 1)


def test_a_file_of_nothing_but_errors_ends() -> None:
    assert read(*(error() for _ in range(1000)), A) == ([], 1)


def test_empty_packets_are_dropped() -> None:
    assert read(SimpleNamespace(size=0), A) == ([A], 0)

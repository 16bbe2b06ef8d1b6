"""The report of `make soak`."""

from dataclasses import replace
from typing import Any

import pytest
from benchmarks.soak import Sample, find_growth

STEADY = [
    Sample(frames, frames / 100, 290 + frames % 7, min(300, 200 + frames), 20, 12)
    for frames in range(0, 20_001, 50)
]


def ending_with(**changes: Any) -> list[Sample]:
    """Return a run that is steady but for its last 100 frames."""
    return [*STEADY[:-2], *(replace(sample, **changes) for sample in STEADY[-2:])]


def ending_at(speed: float) -> list[Sample]:
    """Return a run whose last tenth has another speed, frames a second."""
    last = [s for s in STEADY if s.frames > 18_000]
    slower = [replace(s, seconds=180 + (s.frames - 18_000) / speed) for s in last]
    return [*STEADY[: -len(last)], *slower]


@pytest.mark.parametrize(
    "samples",
    [
        STEADY,
        [replace(s, files=3, threads=1) if s.frames < 500 else s for s in STEADY],
        [*STEADY[:-1], replace(STEADY[-1], files=19, threads=11)],
        ending_with(peak=329),
        ending_at(86.0),
    ],
    ids=["steady", "cold at first", "the reader closes its files", "a little", "a little slower"],
)
def test_nothing_grows_in_a_steady_run(samples: list[Sample]) -> None:
    assert find_growth(samples) == []


@pytest.mark.parametrize(
    ("samples", "words"),
    [
        (
            ending_with(peak=331),
            "peak memory grew by 10.3% after the first 500 frames, from 300",
        ),
        (ending_with(files=21), "the maximum number of files grew from 20 to 21"),
        (ending_with(threads=13), "the maximum number of threads grew from 12 to 13"),
        (ending_at(84.0), "the last tenth ran at 84.0 frames/s, the first at 100.0"),
    ],
)
def test_what_grows_is_named(samples: list[Sample], words: str) -> None:
    (growth,) = find_growth(samples)
    assert growth.startswith(words)

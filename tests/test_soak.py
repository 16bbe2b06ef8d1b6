"""The report of `make soak`."""

from dataclasses import replace
from typing import Any

import pytest
from benchmarks.soak import Sample, find_growth, tenths

STEADY = [
    Sample(frames, frames / 100, 290 + frames % 7, min(300, 200 + frames), 20, 12)
    for frames in range(0, 20_001, 50)
]


def ending_with(**changes: Any) -> list[Sample]:
    """Return a run that is steady but for its last 100 frames."""
    return [*STEADY[:-2], *(replace(sample, **changes) for sample in STEADY[-2:])]


@pytest.mark.parametrize(
    "samples",
    [
        STEADY,
        [replace(s, files=3, threads=1) if s.frames < 500 else s for s in STEADY],
        [*STEADY[:-1], replace(STEADY[-1], files=19, threads=11)],
    ],
    ids=["steady", "cold before the 500th frame", "the reader closes its files at the end"],
)
def test_nothing_grows_in_a_steady_run(samples: list[Sample]) -> None:
    assert find_growth(samples) == []
    assert tenths(samples) == pytest.approx((100, 100))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"peak": 331},
            ["peak memory grew by 10.3% after the first 500 frames, from 300 to 331 MB"],
        ),
        ({"peak": 329}, []),
        ({"files": 21}, ["the maximum number of files grew from 20 to 21"]),
        ({"threads": 13}, ["the maximum number of threads grew from 12 to 13"]),
    ],
)
def test_what_grows_is_named(changes: dict[str, Any], words: list[str]) -> None:
    assert find_growth(ending_with(**changes)) == words


@pytest.mark.parametrize(("speed", "slow"), [(84.0, True), (86.0, False)])
def test_a_run_that_gets_slower_is_named(speed: float, slow: bool) -> None:
    slowing = [
        replace(s, seconds=180 + (s.frames - 18_000) / speed) if s.frames > 18_000 else s
        for s in STEADY
    ]
    words = [f"the last tenth ran at {speed:.1f} frames/s, the first at 100.0"]
    assert find_growth(slowing) == (words if slow else [])

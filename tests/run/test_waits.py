"""How long a run waits for its threads, and what it says of it."""

import logging
from pathlib import Path

import pytest

from run.red_runs import outputs, run_red
from vdet.run.threads import Part, Waits
from vdet.run.video import VideoJob

SOON = 0.01


def waits(reading: float = 0.0, searching: float = 0.0, encoding: float = 0.0) -> Waits:
    waits = Waits()
    waits.seconds = {"reading": reading, "searching": searching, "encoding": encoding}
    return waits


@pytest.mark.parametrize("part", ["reading", "searching", "encoding"])
def test_the_longest_wait_limits_the_run(part: Part) -> None:
    parts = {"reading": 1.0, "searching": 1.5, "encoding": 0.5} | {part: 4.0}
    text = waits(**parts).describe(8.0)
    assert text.startswith(f"{part} limited the run: in 8.0 s it waited ")
    assert f" 4.0 s for {part}" in text


def test_a_run_says_what_limited_it(
    red_clip: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO, "vdet"):
        run_red(VideoJob(red_clip, outputs(video=tmp_path / "out.mp4"), frames=5))
    (line,) = [text for text in caplog.messages if "limited the run" in text]
    assert line.startswith(f"{red_clip}: ")

"""When a video begins, and where that is known from."""

import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from pydantic import ValidationError

from vdet.config.camera import CameraSettings, ClockSettings
from vdet.config.schema import InputSettings, Settings
from vdet.errors import ConfigError
from vdet.traffic.clock import find_clock


@pytest.fixture(autouse=True)
def time_zone(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The zone of the computer: two hours before UTC in summer, one in winter."""
    monkeypatch.setitem(os.environ, "TZ", "CET-1CEST")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


def begin(
    name: str,
    given: str | None = None,
    created: str | None = None,
    start: float = 0.0,
    pattern: str | None = None,
) -> str:
    camera = CameraSettings(clock=ClockSettings(pattern=pattern))
    settings = Settings(input=InputSettings(begin=given), camera=camera)
    return str(find_clock(Path("clips", name), settings, created, start))


def test_a_time_that_is_given_is_taken() -> None:
    name, created = "a_20260501_070000.mp4", "2020-01-01T00:00:00Z"
    assert begin(name, "2026-05-01 07:00-03:00", created) == "2026-05-01 07:00:00-03:00 (as given)"
    assert begin(name, "2026-01-01 07:00") == "2026-01-01 07:00:00+01:00 (as given)"


def test_the_creation_time_comes_before_the_name() -> None:
    created = "2026-05-01T05:00:00.000000Z"
    assert begin("a_20200101_000000.mp4", None, created) == (
        "2026-05-01 07:00:00+02:00 (its creation time)"
    )


@pytest.mark.parametrize("created", [None, "", "1904-01-01T00:00:00Z", "yesterday"])
@pytest.mark.parametrize(
    "name",
    [
        "Gate_FR20_2026-05-01_07-00-00.mp4",
        "20260501_070000.mp4",
        "cam1-2026.05.01 07.00.00.ts",
        "REC2026-05-01T07-00-00.jsonl",
        "99999999_999999_20260501_070000.mp4",
    ],
)
def test_without_a_clock_in_the_file_its_name_says_it(name: str, created: str | None) -> None:
    assert begin(name, None, created) == "2026-05-01 07:00:00+02:00 (from its name)"


@pytest.mark.parametrize("name", ["gate.mp4", "20261301_070000.mp4", "120260501_0700001.mp4"])
def test_a_name_without_a_time_says_nothing(name: str) -> None:
    assert find_clock(Path(name), Settings()) is None


def test_a_pattern_says_how_the_time_is_written() -> None:
    found = begin("x1 01.05.26 07h00m05.mp4", pattern="%d.%m.%y %Hh%Mm%S", created="2020-01-01")
    assert found == "2026-05-01 07:00:05+02:00 (from its name)"
    with pytest.raises(ConfigError, match=r"b\.mp4: its name has no time like %Y_%H%M: camera\.cl"):
        begin("b.mp4", pattern="%Y_%H%M")


def test_the_beginning_is_that_of_the_first_frame() -> None:
    assert begin("a.ts", "2026-05-01 07:00+02:00", start=1.0).startswith("2026-05-01 06:59:59")


@pytest.mark.parametrize("text", ["7 o'clock", "0001-01-01", "2026-05-01 25:00"])
def test_a_text_that_is_not_a_time_is_refused(text: str) -> None:
    with pytest.raises(ValidationError, match="is not a time; give one as in"):
        InputSettings(begin=text)


@pytest.mark.parametrize("text", ["%Y%q", "100%", "clip"])
def test_a_text_that_is_not_a_pattern_is_refused(text: str) -> None:
    with pytest.raises(ValidationError, match="a pattern has only"):
        ClockSettings(pattern=text)

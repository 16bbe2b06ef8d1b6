"""Clips drawn in code, as fixtures."""

from collections.abc import Callable
from pathlib import Path

import pytest

import clips


@pytest.fixture(scope="session")
def draw_frame() -> Callable[[int, int, int], clips.Image]:
    return clips.draw_frame


@pytest.fixture(scope="session")
def read_number() -> Callable[[clips.Image], int]:
    return clips.read_number


@pytest.fixture(scope="session")
def write_clip() -> Callable[..., Path]:
    return clips.write_clip


@pytest.fixture
def warnings(caplog: pytest.LogCaptureFixture) -> Callable[[], list[str]]:
    """Returns the warnings logged so far."""
    return lambda: [record.getMessage() for record in caplog.records if record.name == "vdet"]

"""What several tests of the pipeline need."""

from collections.abc import Callable
from pathlib import Path

import pytest

from red_cars import drive
from run.red_runs import COUNT, video_info
from vdet import plugins
from vdet.config.schema import OutputSettings
from vdet.media.writer import VideoWriter
from vdet.run.sinks.protocol import SinkKind

Register = Callable[[str, SinkKind], None]


@pytest.fixture(scope="session")
def red_clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A video of the red car that drives from left to right."""
    path = tmp_path_factory.mktemp("red") / "red.mp4"
    with VideoWriter(path, video_info(), OutputSettings(crf=10)) as writer:
        for frame in drive(COUNT):
            writer.write(frame)
    return path


@pytest.fixture
def register(monkeypatch: pytest.MonkeyPatch) -> Register:
    """Make a kind of sink known under a name, for one test."""
    kinds: dict[str, SinkKind] = {}
    load = plugins.load_plugin
    monkeypatch.setattr(
        "vdet.run.sinks.protocol.load_plugin",
        lambda group, name: kinds.get(name) or load(group, name),
    )
    return kinds.__setitem__

"""What several tests of the pipeline need."""

from collections.abc import Callable
from pathlib import Path

import pytest

from red_cars import drive
from run.red_runs import COUNT
from running import write_images
from vdet import plugins
from vdet.run.sinks.protocol import SinkKind

Register = Callable[[str, SinkKind], None]


@pytest.fixture(scope="session")
def red_clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A video of the red car that drives from left to right."""
    path = tmp_path_factory.mktemp("red") / "red.mp4"
    return write_images(path, [frame.image for frame in drive(COUNT)], crf=10)


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

"""What several tests of the pipeline need."""

from pathlib import Path

import pytest

from pipeline.red_runs import COUNT, video_info
from red_cars import drive
from vdet.config.schema import OutputSettings
from vdet.media import VideoWriter


@pytest.fixture(scope="session")
def red_clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A video of the red car that drives from left to right."""
    path = tmp_path_factory.mktemp("red") / "red.mp4"
    with VideoWriter(path, video_info(), OutputSettings(crf=10)) as writer:
        for frame in drive(COUNT):
            writer.write(frame)
    return path

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from synthetic.scenes import make_scene, parked
from vdet.media.reader import VideoReader
from vdet.synthetic.render import frames, true_boxes, write_clip, write_truth
from vdet.synthetic.scene import Scene


@pytest.fixture
def scene() -> Scene:
    """Three frames: a vehicle in full view, one hidden behind it, one too small."""
    vehicles = parked(1, 10.0, 0.0), parked(2, 30.0, 0.0), parked(3, 90.0, 9.0)
    return make_scene(*vehicles, size=(640, 360), frames=3)


def test_the_video_shows_the_rendered_frames(tmp_path: Path, scene: Scene) -> None:
    write_clip(tmp_path / "road.mp4", scene)
    with VideoReader(tmp_path / "road.mp4") as reader:
        read = list(reader)
    assert [frame.time for frame in read] == [0, Fraction(1, 25), Fraction(2, 25)]
    for frame, drawn in zip(read, frames(scene), strict=True):
        assert np.abs(frame.image.astype(int) - drawn.image).mean() < 4


def test_truth_is_in_the_columns_of_motchallenge_with_what_is_hidden_or_small_ignored(
    tmp_path: Path, scene: Scene
) -> None:
    write_truth(tmp_path / "gt.txt", scene)
    rows = np.loadtxt(tmp_path / "gt.txt", delimiter=",")
    expected = [
        [index + 1, number, box.x1 + 1, box.y1 + 1, box.width, box.height, flag, 3, visible]
        for index in range(3)
        for number, flag, visible in ((1, 1, 1), (2, 0, 0), (3, 0, 1))
        for box in [true_boxes(scene, index)[number - 1].box]
    ]
    assert rows == pytest.approx(np.array(expected), abs=0.01)

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from vdet.media.reader import VideoReader
from vdet.synthetic.render import frames, write_clip
from vdet.synthetic.scene import Scene, SceneVehicle
from vdet.synthetic.truth import true_boxes, write_truth

MakeScene = Callable[..., Scene]
Parked = Callable[[int, float, float], SceneVehicle]


@pytest.fixture
def scene(make_scene: MakeScene, parked: Parked) -> Scene:
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


def test_truth_lines_are_motchallenge_columns_counting_from_1(tmp_path: Path, scene: Scene) -> None:
    write_truth(tmp_path / "gt.txt", scene)
    rows = np.loadtxt(tmp_path / "gt.txt", delimiter=",")
    assert rows.shape == (9, 9)
    assert rows[:, 0].tolist() == [1, 1, 1, 2, 2, 2, 3, 3, 3]
    assert rows[:3, 1].tolist() == [1, 2, 3]
    assert (rows[:, 7] == 3).all()
    box = true_boxes(scene, 0)[0].box
    assert rows[0, 2:6].tolist() == [box.x1 + 1, box.y1 + 1, box.width, box.height]


def test_hidden_and_small_vehicles_are_ignore_regions(tmp_path: Path, scene: Scene) -> None:
    write_truth(tmp_path / "gt.txt", scene)
    rows = np.loadtxt(tmp_path / "gt.txt", delimiter=",")
    assert rows[:3, 6].tolist() == [1, 0, 0]
    assert rows[:3, 8] == pytest.approx([1, 0, 1], abs=0.01)

"""Labelled videos: which frames are read, and what is compared."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from quick import QUICK
from vdet.config.loading import load_settings
from vdet.detect.detectors import load_detector
from vdet.errors import TruthError
from vdet.evaluate.results import ClipResult, evaluate_video
from vdet.labels.reading import read_truth
from vdet.synthetic import Scene, write_truth
from vdet.workers import Progress, no_progress

FRAMES = 10
Evaluate = Callable[..., ClipResult]


@pytest.fixture
def evaluate(clip_path: Path, model_path: Path) -> Evaluate:
    """Evaluates the clip with quick settings, changed by assignments."""
    model_setting = f"detector.model={model_path}"

    def call(truth: Path, *assignments: str, progress: Progress = no_progress) -> ClipResult:
        settings = load_settings((), (*QUICK, model_setting, *assignments))
        model = load_detector(settings.detector)
        return evaluate_video(clip_path, read_truth(truth), settings, model, progress=progress)

    return call


@pytest.fixture
def truth_path(scene: Scene, tmp_path: Path) -> Path:
    path = tmp_path / "gt.txt"
    write_truth(path, replace(scene, frames=FRAMES))
    return path


def test_only_the_frames_that_the_truth_covers_are_read(
    truth_path: Path, evaluate: Evaluate
) -> None:
    steps: list[int] = []
    result = evaluate(truth_path, progress=lambda *_: steps.append)
    assert result.until == len(steps) == FRAMES


def test_vehicles_outside_the_regions_do_not_count(truth_path: Path, evaluate: Evaluate) -> None:
    middle = 220  # of 320 pixels; two of the three vehicles are to the left of it
    left = "{name: left, points: [[0, 0], [0.6875, 0], [0.6875, 1], [0, 1]]}"
    everywhere, result = evaluate(truth_path), evaluate(truth_path, f"regions=[{left}]")
    for frame in result.comparison.frames:
        for boxes in (frame.vehicle_boxes, frame.track_boxes):
            assert (boxes[:, [0, 2]].mean(axis=1) <= middle).all()
    assert 0 < result.scores.vehicle_boxes < everywhere.scores.vehicle_boxes


def test_truth_beyond_the_video_is_refused(tmp_path: Path, evaluate: Evaluate) -> None:
    truth = tmp_path / "gt.txt"
    truth.write_text("1,1,10,10,50,50,1,3,1\n31,1,10,10,50,50,1,3,1\n")
    with pytest.raises(TruthError, match=r"has 30 frames, but .* has a box in frame 31"):
        evaluate(truth)

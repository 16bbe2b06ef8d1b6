"""Labelled videos under several settings: what is shared, and which frames are read."""

from dataclasses import replace
from pathlib import Path
from typing import Literal, Protocol

import pytest

from quick import QUICK
from vdet.config.loading import load_settings
from vdet.config.schema import DetectorSettings, MotionTrackerSettings, Settings
from vdet.detect.factory import load_detector
from vdet.detect.svm.detector import Candidates, SvmDetector
from vdet.errors import TruthError
from vdet.evaluate.video import ClipResult, Variant, evaluate_clip, open_clip
from vdet.media import Picture
from vdet.progress import no_progress
from vdet.synthetic.scene import Scene
from vdet.synthetic.truth import write_truth

FRAMES = 10
AHEAD = MotionTrackerSettings(look_ahead=0.3)  # longer than a few frames


def settings(*assignments: str) -> Settings:
    return load_settings((), (*QUICK, *assignments))


class OfModel(Protocol):
    """Makes a variant of the quick settings, with the shared model."""

    def __call__(self, *assignments: str) -> Variant: ...


@pytest.fixture
def variant(model_path: Path) -> OfModel:
    def make(*assignments: str) -> Variant:
        chosen = settings(*assignments)
        return Variant(
            chosen,
            load_detector(chosen.detector.model_copy(update={"model": str(model_path)})),
            assignments,
        )

    return make


@pytest.fixture
def truth_path(scene: Scene, tmp_path: Path) -> Path:
    path = tmp_path / "gt.txt"
    write_truth(path, replace(scene, frames=FRAMES))
    return path


def test_settings_side_by_side_give_what_each_gives_alone(
    clip_path: Path, truth_path: Path, variant: OfModel
) -> None:
    motion = settings().model_copy(update={"tracker": MotionTrackerSettings()})
    variants = [
        variant("detector.heat.threshold=0.1"),
        variant("detector.heat.threshold=0.3", "detector.heat.frames=3"),
        variant("detector.search.probability=0.8"),
        variant("tracker.history=2"),
        variant("detector.stride=2"),
        variant("detector.search.perspective.sizes=[0.25]", "detector.stride=3"),
        variant("detector.search.perspective={sizes: [0.25], horizon: 0.5}"),
        variant("detector.heat.votes=0.02"),
        replace(variant(), settings=motion),
    ]
    clip = open_clip(clip_path, truth_path)
    together = [boxes_of(result) for result in evaluate_clip(clip, variants)]
    alone = [boxes_of(result) for one in variants for result in evaluate_clip(clip, [one])]
    assert together == alone
    assert len(set(alone)) > 1, "the settings should differ in what they find"


def boxes_of(result: ClipResult) -> str:
    """Return the boxes that were found in each frame, with their ids and scores."""
    frames = result.comparison.frames
    return repr(
        [
            (
                frame.number,
                *(item.tolist() for item in (frame.tracks, frame.track_boxes, frame.scores)),
            )
            for frame in frames
        ]
    )


@pytest.fixture
def searched(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The numbers of the frames that are searched, one for each search."""
    searched: list[int] = []
    search = SvmDetector.search

    def counted(self: SvmDetector, picture: Picture, index: int | None) -> Candidates:
        assert index is not None
        searched.append(index)
        return search(self, picture, index)

    monkeypatch.setattr(SvmDetector, "search", counted)
    return searched


def test_settings_that_search_alike_share_the_search(
    clip_path: Path, truth_path: Path, variant: OfModel, searched: list[int]
) -> None:
    motion = replace(variant(), settings=settings().model_copy(update={"tracker": AHEAD}))
    variants = [
        variant(),
        variant("detector.heat.threshold=1"),
        variant("tracker.history=2"),
        motion,
        variant("detector.search.probability=0.9"),
    ]
    assert len(evaluate_clip(open_clip(clip_path, truth_path), variants)) == 5
    twice = [index for index in range(FRAMES) for _ in range(2)]
    assert sorted(searched) == twice, "two searches a frame for five settings"


class ListingSettings(DetectorSettings):
    """Settings of another package's detector, which have no hash."""

    kind: Literal["listing"] = "listing"
    weights: dict[str, list[float]]


def test_settings_of_a_plug_in_may_hold_lists(
    clip_path: Path, truth_path: Path, variant: OfModel
) -> None:
    detector = ListingSettings(weights={"car": [1.0]})
    listing = replace(variant(), settings=settings().model_copy(update={"detector": detector}))
    results = evaluate_clip(open_clip(clip_path, truth_path), [listing, listing])
    assert [result.until for result in results] == [FRAMES, FRAMES]


def test_only_the_frames_that_the_truth_covers_are_read(
    clip_path: Path, truth_path: Path, variant: OfModel
) -> None:
    steps: list[int] = []
    clip = open_clip(clip_path, truth_path)
    (result,) = evaluate_clip(clip, [variant()], lambda _: steps.append)
    assert result.until == len(steps) == FRAMES


def test_vehicles_outside_the_regions_do_not_count(
    clip_path: Path, truth_path: Path, variant: OfModel
) -> None:
    clip = open_clip(clip_path, truth_path)
    middle = 220  # of 320 pixels; two of the three vehicles are to the left of it
    left = "{name: left, points: [[0, 0], [0.6875, 0], [0.6875, 1], [0, 1]]}"
    (result,) = evaluate_clip(clip, [variant(f"regions=[{left}]")], no_progress)
    for frame in result.comparison.frames:
        for boxes in (frame.vehicle_boxes, frame.track_boxes):
            assert (boxes[:, [0, 2]].mean(axis=1) <= middle).all()
    assert 0 < result.scores.vehicle_boxes < (~clip.truth.ignored).sum()


def test_truth_beyond_the_video_is_refused(
    clip_path: Path, tmp_path: Path, variant: OfModel
) -> None:
    truth = tmp_path / "gt.txt"
    truth.write_text("1,1,10,10,50,50,1,3,1\n31,1,10,10,50,50,1,3,1\n")
    with pytest.raises(TruthError, match=r"gt\.txt: has a box in frame 31 of a video of 30"):
        evaluate_clip(open_clip(clip_path, truth), [variant()], no_progress)

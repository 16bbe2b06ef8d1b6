from dataclasses import replace
from pathlib import Path

import pytest
from vdet.pipeline.following import follow

from quick import QUICK
from vdet.config.loading import load_settings
from vdet.config.schema import Settings
from vdet.detect.svm.model import LinearModel, load_model
from vdet.detect.svm.search import FrameSearch
from vdet.detect.svm.windows import Windows
from vdet.errors import TruthError
from vdet.evaluate.clips.clip import detect, open_clip
from vdet.evaluate.clips.evaluate import Variant, evaluate_clips
from vdet.evaluate.clips.following import follow_under_all
from vdet.media import VideoReader
from vdet.media.images import Image
from vdet.synthetic.clip import write_truth
from vdet.synthetic.scene import Scene

FRAMES = 10


def settings(*assignments: str) -> Settings:
    return load_settings(None, (*QUICK, *assignments))


@pytest.fixture(scope="module")
def model(model_path: Path) -> LinearModel:
    return load_model(model_path)


@pytest.fixture
def truth_path(scene: Scene, tmp_path: Path) -> Path:
    path = tmp_path / "gt.txt"
    write_truth(path, replace(scene, frames=FRAMES))
    return path


def test_settings_side_by_side_give_what_each_gives_alone(
    clip_path: Path, model: LinearModel
) -> None:
    variants = [
        settings("detector.heat.threshold=0.1"),
        settings("detector.heat.threshold=0.3", "detector.heat.frames=3"),
        settings("detector.search.probability=0.8"),
        settings("tracker.history=2"),
        settings("detector.search.perspective.sizes=[0.25]", "detector.search.alternate=2"),
        settings("detector.search.perspective={sizes: [0.25], horizon: 0.5}"),
        settings("detector.heat.regions=votes", "detector.heat.votes.least=0.02"),
        settings("tracker={method: motion, motion: {strong: 0.05}}"),
    ]
    with VideoReader(clip_path, frames=FRAMES) as reader:
        frames = list(reader)
    together = list(follow_under_all(frames, model, variants, 320, 180))
    assert [frame.index for frame, _ in together] == list(range(FRAMES))
    alone = [
        [result.tracks for result in follow(frames, model, each, 320, 180)] for each in variants
    ]
    assert [list(tracks) for tracks in zip(*alone, strict=True)] == [t for _, t in together]
    assert len({str(each) for each in alone}) > 1, "the settings should differ in what they find"


def test_settings_that_search_alike_share_the_search(
    clip_path: Path, model: LinearModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    searched: list[int | None] = []

    def search(self: FrameSearch, image: Image, turn: int | None = None) -> Windows:
        searched.append(turn)
        return whole(self, image, turn)

    whole = FrameSearch.search
    monkeypatch.setattr(FrameSearch, "search", search)
    variants = [
        settings(),
        settings("detector.heat.threshold=1"),
        settings("detector.search.probability=0.9"),
    ]
    with VideoReader(clip_path, frames=3) as reader:
        assert len(list(follow_under_all(reader, model, variants, 320, 180))) == 3
    assert searched == [0, 0, 1, 1, 2, 2]


def test_only_the_frames_that_the_truth_covers_are_read(
    clip_path: Path, truth_path: Path, model: LinearModel
) -> None:
    steps: list[int] = []
    clip = open_clip(clip_path, truth_path)
    (found,) = detect(clip, model, [settings()], lambda _: steps.append)
    assert found.frame_count == len(steps) == FRAMES
    assert found.rate == 25


def test_until_ends_sooner(clip_path: Path, truth_path: Path, model: LinearModel) -> None:
    clip = open_clip(clip_path, truth_path, until=4)
    (run,) = evaluate_clips([clip], model, [Variant((), settings())])
    assert max(frame.number for frame in run.clips[0].comparison.frames) == 4


def test_truth_beyond_the_video_is_refused_with_its_line(
    clip_path: Path, tmp_path: Path, model: LinearModel
) -> None:
    truth = tmp_path / "gt.txt"
    truth.write_text("1,1,10,10,50,50,1,3,1\n31,1,10,10,50,50,1,3,1\n")
    with pytest.raises(TruthError, match=r"gt\.txt:2: the frame is number 31 of a video of 30"):
        detect(open_clip(clip_path, truth), model, [settings()], lambda _: lambda _: None)


def test_clips_are_pooled_under_each_setting(
    clip_path: Path, truth_path: Path, model: LinearModel
) -> None:
    clips = [open_clip(clip_path, truth_path, until=3), open_clip(clip_path, truth_path, until=2)]
    variants = [Variant((f"heat.threshold={n}",), settings(f"heat.threshold={n}")) for n in (1, 2)]
    runs = evaluate_clips(clips, model, variants)
    assert [run.assignments for run in runs] == [
        ("detector.heat.threshold=1",),
        ("detector.heat.threshold=2",),
    ]
    for run in runs:
        boxes = [clip.scores.vehicle_boxes for clip in run.clips]
        assert run.total.vehicle_boxes == sum(boxes) > 0

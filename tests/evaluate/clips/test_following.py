from dataclasses import replace
from pathlib import Path

import pytest

from quick import QUICK
from vdet.config.loading import load_settings
from vdet.config.schema import Settings
from vdet.detect.factory import load_detector
from vdet.detect.svm.detector import Candidates, SvmDetector
from vdet.errors import TruthError
from vdet.evaluate.clips.clip import detect, open_clip
from vdet.evaluate.clips.evaluate import Variant, evaluate_clips
from vdet.evaluate.clips.following import follow_under_all
from vdet.media import VideoReader
from vdet.media.images import Image
from vdet.pipeline.loop import follow_frames, peek
from vdet.synthetic.clip import write_truth
from vdet.synthetic.scene import Scene
from vdet.track.track import Track

FRAMES = 10


def settings(*assignments: str) -> Settings:
    return load_settings(None, (*QUICK, *assignments))


@pytest.fixture
def truth_path(scene: Scene, tmp_path: Path) -> Path:
    path = tmp_path / "gt.txt"
    write_truth(path, replace(scene, frames=FRAMES))
    return path


def tracks_alone(clip_path: Path, model_path: Path, variant: Settings) -> list[tuple[Track, ...]]:
    """Return the tracks of each frame under one of the settings."""
    with VideoReader(clip_path, frames=FRAMES) as reader:
        info = reader.info
        images, frames = peek(reader)
        detector = load_detector(variant.detector, model_path)
        video_detector = detector.for_video(info.width, info.height, images)
        results = list(follow_frames(frames, video_detector, variant, info))
    return [result.tracks for result in results]


def test_settings_side_by_side_give_what_each_gives_alone(
    clip_path: Path, model_path: Path
) -> None:
    variants = [
        settings("detector.heat.threshold=0.1"),
        settings("detector.heat.threshold=0.3", "detector.heat.frames=3"),
        settings("detector.search.probability=0.8"),
        settings("tracker.history=2"),
        settings("detector.search.perspective.sizes=[0.25]", "detector.search.alternate=2"),
        settings("detector.search.perspective={sizes: [0.25], horizon: 0.5}"),
        settings("detector.heat.regions=votes", "detector.heat.votes.least=0.02"),
        load_settings(None, [text for text in QUICK if not text.startswith("tracker")]),
    ]
    with VideoReader(clip_path, frames=FRAMES) as reader:
        together = list(follow_under_all(reader, variants, model_path, reader.info))
    assert [results[0].frame.index for results in together] == list(range(FRAMES))
    alone = [tracks_alone(clip_path, model_path, each) for each in variants]
    assert [[result.tracks for result in results] for results in together] == [
        list(tracks) for tracks in zip(*alone, strict=True)
    ]
    assert len({str(each) for each in alone}) > 1, "the settings should differ in what they find"


def test_settings_with_the_same_detector_share_the_search(
    clip_path: Path, model_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    searched: list[int | None] = []

    def search(self: SvmDetector, image: Image, index: int | None) -> Candidates:
        searched.append(index)
        return whole(self, image, index)

    whole = SvmDetector.search
    monkeypatch.setattr(SvmDetector, "search", search)
    variants = [
        settings(),
        settings("tracker.history=2"),
        settings("detector.search.probability=0.9"),
    ]
    with VideoReader(clip_path, frames=3) as reader:
        assert len(list(follow_under_all(reader, variants, model_path, reader.info))) == 3
    assert searched == [0, 0, 1, 1, 2, 2]


def test_only_the_frames_that_the_truth_covers_are_read(
    clip_path: Path, truth_path: Path, model_path: Path
) -> None:
    steps: list[int] = []
    clip = open_clip(clip_path, truth_path)
    (found,) = detect(clip, [settings()], model_path, lambda _: steps.append)
    assert found.frame_count == len(steps) == FRAMES
    assert found.rate == 25


def test_until_ends_sooner(clip_path: Path, truth_path: Path, model_path: Path) -> None:
    clip = open_clip(clip_path, truth_path, until=4)
    (run,) = evaluate_clips([clip], model_path, [Variant((), settings())])
    assert max(frame.number for frame in run.clips[0].comparison.frames) == 4


def test_truth_beyond_the_video_is_refused_with_its_line(
    clip_path: Path, tmp_path: Path, model_path: Path
) -> None:
    truth = tmp_path / "gt.txt"
    truth.write_text("1,1,10,10,50,50,1,3,1\n31,1,10,10,50,50,1,3,1\n")
    with pytest.raises(TruthError, match=r"gt\.txt:2: the frame is number 31 of a video of 30"):
        detect(open_clip(clip_path, truth), [settings()], model_path, lambda _: lambda _: None)


def test_clips_are_pooled_under_each_setting(
    clip_path: Path, truth_path: Path, model_path: Path
) -> None:
    clips = [open_clip(clip_path, truth_path, until=3), open_clip(clip_path, truth_path, until=2)]
    texts = ["detector.heat.threshold=1", "detector.heat.threshold=2"]
    variants = [Variant((text,), settings(text)) for text in texts]
    runs = evaluate_clips(clips, model_path, variants)
    assert [run.assignments for run in runs] == [(text,) for text in texts]
    for run in runs:
        boxes = [clip.scores.vehicle_boxes for clip in run.clips]
        assert run.total.vehicle_boxes == sum(boxes) > 0

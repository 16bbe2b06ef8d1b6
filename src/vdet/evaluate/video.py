"""Scores of labelled videos, whose vehicles are found under one or several settings.

The search takes nearly all the time, so settings that search alike share it: every frame is
searched once for them, and only what follows the search runs for each.
"""

import itertools
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from vdet.boxes import Box, Boxes
from vdet.config.schema import Settings
from vdet.detect.protocol import DetectorModel
from vdet.errors import VideoError
from vdet.evaluate.comparison import Comparison, compare, pool
from vdet.evaluate.scores import Scores, score_comparison
from vdet.evaluate.timelines import Stretch, mistakes, stretches
from vdet.labels.label import Label
from vdet.labels.reading import read_predictions, read_truth
from vdet.labels.roles import DEFAULT_ROLES, Roles
from vdet.labels.video import LabelledVideo
from vdet.media import Frame, Picture, VideoInfo
from vdet.media.reader import VideoReader
from vdet.progress import Progress, no_progress
from vdet.regions import Regions, lay_regions
from vdet.run.loop import build, named_errors, peek
from vdet.run.result import FrameResult


@dataclass(frozen=True, slots=True, eq=False)
class Clip:
    """A video and the truth of its frames up to number `until`; None: of all frames."""

    video: Path
    truth_path: Path
    truth: LabelledVideo
    until: int | None


@dataclass(frozen=True, slots=True, eq=False)
class Variant:
    """Settings to compare with others, and the detector that was loaded with them.

    `assignments` are those in which the settings differ from the others, as `--set` takes them.
    """

    settings: Settings
    model: DetectorModel
    assignments: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class ClipResult:
    """The scores of one video under one of the settings.

    `name` is shown in tables; `video` is the file, None if a file of tracks is scored. The frames
    up to `until`, counted from 1, are compared. `left_out` is the number of boxes in later frames.
    """

    name: str
    video: Path | None
    comparison: Comparison
    scores: Scores
    stretches: tuple[Stretch, ...]
    until: int
    left_out: int = 0

    @property
    def mistakes(self) -> tuple[Stretch, ...]:
        """The missed vehicles and the false alarms, the longest first."""
        return mistakes(self.stretches)


@dataclass(frozen=True, slots=True, eq=False)
class RunResult:
    """The scores of all videos under one of the settings, and their total.

    `assignments` are those of the `Variant`.
    """

    assignments: tuple[str, ...]
    clips: tuple[ClipResult, ...]
    total: Scores

    @staticmethod
    def of(assignments: tuple[str, ...], clips: Sequence[ClipResult]) -> "RunResult":
        """Return the result with the total of all clips, taken as one video."""
        if len(clips) == 1:
            return RunResult(assignments, tuple(clips), clips[0].scores)
        total = score_comparison(pool([clip.comparison for clip in clips]))
        return RunResult(assignments, tuple(clips), total)


def open_clip(
    video: Path, truth_path: Path, until: int | None = None, roles: Roles = DEFAULT_ROLES
) -> Clip:
    """Read the truth of a video.

    Parameters
    ----------
    until
        Number of the last frame to use, from 1; None: the last that the truth covers.
    roles
        What the labels of the truth mean.

    Raises
    ------
    TruthError
        The truth cannot be used.
    """
    truth = read_truth(truth_path, roles)
    if until is not None:
        truth = truth.until(until)
    return Clip(video, truth_path, truth, until or truth.last_frame or None)


def evaluate_clips(
    clips: Sequence[Clip], variants: Sequence[Variant], progress: Progress = no_progress
) -> list[RunResult]:
    """Find the vehicles in every clip, in one pass for all settings, and score each.

    Arguments and errors as of `evaluate_clip`, which is called for each clip.
    """
    results = [evaluate_clip(clip, variants, progress) for clip in clips]
    return [
        RunResult.of(variant.assignments, of_clips)
        for variant, of_clips in zip(variants, zip(*results, strict=True), strict=True)
    ]


def score_video(
    name: str,
    prediction: LabelledVideo,
    truth: LabelledVideo,
    *,
    video: Path | None = None,
    rate: float | None = None,
) -> ClipResult:
    """Score the predictions for a video and list their mistakes; arguments as in `compare`."""
    comparison = compare(prediction, truth, rate=rate)
    until = max(prediction.last_frame, truth.last_frame)
    scores = score_comparison(comparison)
    return ClipResult(name, video, comparison, scores, stretches(comparison), until)


def score_files(
    prediction: Path,
    truth: Path,
    roles: Roles = DEFAULT_ROLES,
    *,
    until: int | None = None,
    rate: float | None = None,
) -> RunResult:
    """Score a file of tracks against a file of truth.

    Parameters
    ----------
    roles
        What the labels of the truth mean.
    until
        Number of the last frame to use, from 1; None: the last that the truth covers.
    rate
        As `compare` takes it.

    Raises
    ------
    TruthError
        A file cannot be used.
    """
    found, true = read_predictions(prediction), read_truth(truth, roles)
    last = until or true.last_frame
    compared = found.until(last)
    result = score_video(str(prediction), compared, true.until(last), rate=rate)
    return RunResult.of((), [replace(result, left_out=len(found) - len(compared))])


def best(runs: Sequence[RunResult]) -> RunResult:
    """Return the run with the highest F1, the first of equal ones."""
    return max(runs, key=lambda run: run.total.f1)


def evaluate_clip(clip: Clip, variants: Sequence[Variant], progress: Progress) -> list[ClipResult]:
    """Find the vehicles of a clip under each of the settings, in one pass, and score them.

    Vehicles of the truth that stand outside the regions are ignored.

    Parameters
    ----------
    progress
        Called with the expected number of frames (None: unknown); what it returns is called with
        the number of frames done since the last call.

    Raises
    ------
    VideoError
        The video cannot be read or searched.
    TruthError
        The truth covers frames beyond the end of the video.
    """
    rows: list[list[Label]] = [[] for _ in variants]
    frames = 0
    source = variants[0].settings.input
    with VideoReader(clip.video, frames=clip.until, settings=source) as reader:
        advance = progress(reader.expected)
        with named_errors(clip.video, VideoError):
            for results in follow_together(variants, reader, reader.info):
                for row, result in zip(rows, results, strict=True):
                    number = result.frame.index + 1
                    row += [
                        Label(0, track.box.pixels, frame=number, id=track.id, score=track.score)
                        for track in result.tracks
                    ]
                frames = results[0].frame.index + 1
                advance(1)
        info = reader.info
    clip.truth.check_end(clip.truth_path, frames)
    truth = clip.truth.until(frames)
    scored = []
    for variant, labels in zip(variants, rows, strict=True):
        found = LabelledVideo.of(labels, frame_count=frames, rate=float(info.rate))
        regions = lay_regions(variant.settings.regions, info.width, info.height)
        counted = _in_regions(truth, regions)
        scored.append(score_video(str(clip.video), found, counted, video=clip.video))
    return scored


def follow_together(
    variants: Sequence[Variant], frames: Iterable[Frame], video: VideoInfo
) -> Iterator[tuple[FrameResult, ...]]:
    """Yield for each frame the results under all settings.

    Errors as of `vdet.run.loop.build`.
    """
    images, read = peek(frames)
    pipelines = [build(each.model, each.settings, video, images) for each in variants]
    del images  # else they stay in memory for the whole run
    keys = [  # what a search depends on
        (each.settings.detector.search_key, each.settings.regions, own.rate)
        for each, own in zip(variants, pipelines, strict=True)
    ]
    searches: dict[int, _Search] = {}  # by the first of the variants that share it
    runs = []
    for own, key, copy in zip(pipelines, keys, itertools.tee(read, len(keys)), strict=True):
        first = keys.index(key)
        if first not in searches:
            searches[first] = _shared(own.detector.search, keys.count(key))
        detector = _Sharing(searches[first], own.detector.detect)
        runs.append(replace(own, detector=detector).follow(copy, video.path))
    yield from zip(*runs, strict=True)


_Search = Callable[[Picture, int | None], Any]


@dataclass(frozen=True, slots=True)
class _Sharing:
    """A detector that shares its search with others."""

    search: _Search
    detect: Callable[[Any], Boxes]


def _shared(search: _Search, users: int) -> _Search:
    """Return a search that runs once for each frame, also if several threads ask for it.

    What it finds is kept until all users have asked for it.
    """
    lock = threading.Lock()
    found: dict[int | None, list[Any]] = {}  # candidates, once for each user who will still ask

    def locked(picture: Picture, index: int | None) -> Any:
        with lock:
            if index not in found:
                found[index] = [search(picture, index)] * users
            candidates = found[index].pop()
            if not found[index]:
                del found[index]
            return candidates

    return locked


def _in_regions(truth: LabelledVideo, regions: Regions | None) -> LabelledVideo:
    """Return the truth of a video, in which vehicles outside the regions are ignored."""
    if regions is None:
        return truth
    outside = [not regions.contains(Box(*sides).foot) for sides in truth.boxes.tolist()]
    return replace(truth, ignored=truth.ignored | np.array(outside, np.bool_))

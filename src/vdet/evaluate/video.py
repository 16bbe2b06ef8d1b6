"""Scores of labelled videos, whose vehicles are found under one or several settings.

The search takes nearly all the time, so settings that search alike share it: every frame is
searched once for them, and only what follows the search runs for each.
"""

import itertools
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from vdet.boxes import Box, Boxes
from vdet.config.schema import Settings
from vdet.detect.protocol import DetectorModel
from vdet.errors import VideoError
from vdet.evaluate.comparison import Comparison, compare, pool
from vdet.evaluate.scores import Scores, score_comparison
from vdet.labels.label import Label, LabelledVideo
from vdet.labels.reading import read_predictions, read_truth
from vdet.labels.roles import Roles
from vdet.media import Frame, Picture, VideoInfo
from vdet.media.reader import VideoReader
from vdet.progress import Progress, no_progress
from vdet.regions import Regions, lay_regions
from vdet.run.loop import build, named_errors, peek
from vdet.run.result import FrameResult

_DEFAULT = Settings()


@dataclass(frozen=True, slots=True, eq=False)
class Clip:
    """A video and the truth of its first frames; of all, if the truth has no last frame."""

    video: Path
    truth_path: Path
    truth: LabelledVideo


@dataclass(frozen=True, slots=True, eq=False)
class Variant:
    """Settings to compare with others, and the detector that was loaded with them.

    `assignments` are those in which the settings differ from the others, as `--set` takes them.
    """

    settings: Settings
    model: DetectorModel
    assignments: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ClipResult:
    """One video under one of the settings, or several videos taken as one.

    `name` is shown in tables; `video` is the file, None if a file of tracks is scored. The frames
    up to `until`, counted from 1, are compared.
    """

    name: str
    comparison: Comparison
    until: int = 0
    video: Path | None = None

    @cached_property
    def scores(self) -> Scores:
        """All metrics."""
        return score_comparison(self.comparison)


@dataclass(frozen=True, eq=False)
class RunResult:
    """All videos under one of the settings; `assignments` are those of the `Variant`."""

    clips: Sequence[ClipResult]
    assignments: tuple[str, ...] = ()

    @cached_property
    def total(self) -> ClipResult:
        """All videos, taken as one."""
        parts = [clip.comparison for clip in self.clips]
        return ClipResult("total", pool(parts)) if len(parts) > 1 else self.clips[0]


def open_clip(
    video: Path, truth_path: Path, until: int | None = None, settings: Settings = _DEFAULT
) -> Clip:
    """Read the truth of a video.

    Parameters
    ----------
    until
        Number of the last frame to use, from 1; None: the last that the truth covers.
    settings
        With the classes that are looked for, and the roles of labels.

    Raises
    ------
    TruthError
        The truth cannot be used.
    """
    truth = read_truth(truth_path, Roles.from_settings(settings))
    return Clip(video, truth_path, truth.until(until) if until else truth)


def score_files(
    prediction: Path, truth_path: Path, until: int | None = None, settings: Settings = _DEFAULT
) -> ClipResult:
    """Score a file of tracks against a file of truth; arguments as of `open_clip`.

    Tracks in later frames are left out.

    Raises
    ------
    TruthError
        A file cannot be used.
    """
    found, truth = (
        read_predictions(prediction),
        read_truth(truth_path, Roles.from_settings(settings)),
    )
    last = until or truth.last_frame
    return ClipResult(str(prediction), compare(found.until(last), truth.until(last)), last)


def evaluate_clips(
    clips: Sequence[Clip], variants: Sequence[Variant], progress: Progress = no_progress
) -> list[RunResult]:
    """Find the vehicles in every clip, in one pass for all settings, and score each.

    Arguments and errors as of `evaluate_clip`, which is called for each clip.
    """
    results = [evaluate_clip(clip, variants, progress) for clip in clips]
    by_variant = zip(variants, zip(*results, strict=True), strict=True)
    return [RunResult(of_clips, variant.assignments) for variant, of_clips in by_variant]


def evaluate_clip(
    clip: Clip, variants: Sequence[Variant], progress: Progress = no_progress
) -> list[ClipResult]:
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
    source, last, frames = variants[0].settings.input, clip.truth.last_frame, 0
    with VideoReader(clip.video, frames=last or None, settings=source) as reader:
        advance, info = progress(reader.expected), reader.info
        with named_errors(clip.video, VideoError):
            for results in follow_together(variants, reader, info):
                for labels, result in zip(rows, results, strict=True):
                    labels.extend(_labels(result))
                frames += 1
                advance(1)
    clip.truth.check_end(clip.truth_path, frames)
    truth = clip.truth.until(frames)
    scored = []
    for variant, labels in zip(variants, rows, strict=True):
        regions = lay_regions(variant.settings.regions, info.width, info.height)
        comparison = compare(LabelledVideo.of(labels), _in_regions(truth, regions))
        scored.append(ClipResult(str(clip.video), comparison, frames, video=clip.video))
    return scored


def _labels(result: FrameResult) -> Iterator[Label]:
    for track in result.tracks:
        box, number = track.box.pixels, result.frame.index + 1
        yield Label(0, box, track.class_name, number, track.id, track.score)


def _in_regions(truth: LabelledVideo, regions: Regions | None) -> LabelledVideo:
    """Return the truth of a video, in which vehicles outside the regions are ignored."""
    if regions is None:
        return truth
    outside = [not regions.contains(Box(*sides).foot) for sides in truth.boxes.tolist()]
    return replace(truth, ignored=truth.ignored | np.array(outside, np.bool_))


def follow_together(
    variants: Sequence[Variant], frames: Iterable[Frame], video: VideoInfo
) -> Iterator[tuple[FrameResult, ...]]:
    """Yield for each frame the results under all settings.

    Errors as of `vdet.run.loop.build`.
    """
    images, read = peek(frames)
    pipelines = [build(variant.model, variant.settings, video, images) for variant in variants]
    del images  # else they stay in memory for the whole run
    keys = [  # what a search depends on
        (variant.settings.detector.search_key, variant.settings.regions, own.rate)
        for variant, own in zip(variants, pipelines, strict=True)
    ]
    searches = [
        _shared(own.detector.search, keys.count(key))
        for own, key in zip(pipelines, keys, strict=True)
    ]
    runs = []
    for own, key, copy in zip(pipelines, keys, itertools.tee(read, len(keys)), strict=True):
        search = searches[keys.index(key)]  # that of the first variant that searches alike
        detector = _Sharing(search, own.detector.detect)
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

"""Scores of labelled videos, whose vehicles are found under one or several settings.

The search takes nearly all the time, so settings that search alike share it: what is found in each
frame is kept for the next ones, and only what follows the search runs for each.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from vdet.boxes import Box, Boxes
from vdet.config.schema import Settings
from vdet.detect.protocol import DetectorModel, VideoDetector
from vdet.errors import VideoError
from vdet.evaluate.comparison import Comparison, compare, pool
from vdet.evaluate.scores import Scores, score_comparison
from vdet.labels.label import Label, LabelledVideo
from vdet.labels.reading import read_predictions, read_truth
from vdet.labels.roles import Roles
from vdet.media import Picture
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
    """Find the vehicles in every clip under each of the settings, and score them.

    Arguments and errors as of `evaluate_clip`, which is called for each clip.
    """
    results = [evaluate_clip(clip, variants, progress) for clip in clips]
    by_variant = zip(variants, zip(*results, strict=True), strict=True)
    return [RunResult(of_clips, variant.assignments) for variant, of_clips in by_variant]


def evaluate_clip(
    clip: Clip, variants: Sequence[Variant], progress: Progress = no_progress
) -> list[ClipResult]:
    """Find the vehicles of a clip under each of the settings, and score them.

    Vehicles of the truth that stand outside the regions are ignored.

    Parameters
    ----------
    progress
        Called for each of the settings with the expected number of frames (None: unknown); what it
        returns is called with the number of frames done since the last call.

    Raises
    ------
    VideoError
        The video cannot be read or searched.
    TruthError
        The truth covers frames beyond the end of the video.
    """
    candidates = defaultdict[str, dict[int | None, Any]](dict)
    results = []
    for variant in variants:
        settings = variant.settings
        source, last = settings.input, clip.truth.last_frame or None
        labels, frames = list[Label](), 0
        with VideoReader(clip.video, frames=last, settings=source) as reader:
            advance, info = progress(reader.expected), reader.info
            with named_errors(clip.video, VideoError):
                images, read = peek(reader)
                own = build(variant.model, settings, info, images)
                del images  # else they stay in memory for the whole run
                detector = _Sharing(own.detector, candidates[_search_key(settings)])
                for result in replace(own, detector=detector).follow(read, clip.video):
                    labels += _labels(result)
                    frames += 1
                    advance(1)
        clip.truth.check_end(clip.truth_path, frames)
        regions = lay_regions(settings.regions, info.width, info.height)
        truth = _in_regions(clip.truth.until(frames), regions)
        comparison = compare(LabelledVideo.of(labels), truth)
        results.append(ClipResult(str(clip.video), comparison, frames, video=clip.video))
    return results


def _search_key(settings: Settings) -> str:
    """Return what the candidates of a frame depend on."""
    detector = settings.detector
    return repr((detector.search_key, detector.model, detector.stride, settings.regions))


@dataclass(frozen=True, slots=True)
class _Sharing:
    """A detector that searches only frames of which `candidates` are not known yet."""

    own: VideoDetector
    candidates: dict[int | None, Any]

    def search(self, picture: Picture, index: int | None) -> Any:
        if index not in self.candidates:
            self.candidates[index] = self.own.search(picture, index)
        return self.candidates[index]

    def detect(self, candidates: Any) -> Boxes:
        return self.own.detect(candidates)


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

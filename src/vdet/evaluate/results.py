"""The results of a detector or tracker in labelled images and in labelled videos."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from itertools import compress
from pathlib import Path
from statistics import fmean
from typing import Any, Self

import numpy as np

from vdet.boxes import Boxes
from vdet.config.schema import Settings
from vdet.detect.detectors import DetectorModel
from vdet.evaluate.scores import (
    Comparison,
    DetectionScores,
    RankedPredictions,
    Scores,
    compare,
    compare_frames,
    pool,
    rank_predictions,
    score_boxes,
    score_comparison,
)
from vdet.findings import warnings_in
from vdet.labels.images import LabelledImage, LabelledImages
from vdet.labels.label import SavedTracks
from vdet.labels.reading import Roles, read_tracks, read_truth
from vdet.progress import Progress, no_progress
from vdet.regions import Regions
from vdet.run.images import ImageSearch
from vdet.run.loop import Parts
from vdet.run.threads import SearchThreads
from vdet.run.video import Results, Run
from vdet.track.track import Track

_MAX_DETECTIONS = 1000  # in an image, those of the highest scores

_log = logging.getLogger("vdet")

_DEFAULT = Settings()


@dataclass(frozen=True, slots=True)
class Counting:
    """The rule for which boxes count.

    Attributes
    ----------
    score
        Detections with at least this score count.
    min_width
        Vehicles narrower than this fraction of the image's width are ignore regions, and narrower
        detections count only if they match a vehicle.
    scores
        The minimum scores of classes for which it is not `score`.
    """

    score: float
    min_width: float
    scores: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredImage:
    """A searched image, compared with its labels like a video of one frame.

    Attributes
    ----------
    every, shown
        The vehicles compared with the detections of every score, and with those that count.
    """

    labelled: LabelledImage
    every: Comparison
    shown: Comparison

    @classmethod
    def of(cls, image: LabelledImage, width: int, boxes: Boxes, counting: Counting) -> Self:
        """Compare the detections with the labels of an image, `width` pixels wide."""
        minimum = counting.min_width * width
        truth = [
            replace(label, id=number, ignored=label.ignored or label.box.width < minimum)
            for number, label in enumerate(image.labels)
        ]
        is_labelled = [name not in image.unlabelled for name in boxes.class_names]
        boxes = boxes[np.flatnonzero(is_labelled)]
        boxes = boxes[np.argsort(-boxes.scores, kind="stable")[:_MAX_DETECTIONS]]
        detected = [
            Track(
                *(number, found.box, found.score, "detected", found.class_name),
                ignored=found.box.width < minimum,
            )
            for number, found in enumerate(boxes)
        ]
        shown = list(compress(detected, boxes.reach(counting.score, counting.scores)))
        every, counted = (compare_frames({0: labels}, {0: truth}) for labels in (detected, shown))
        return cls(image, every, counted)


@dataclass(frozen=True)
class ImageScores(DetectionScores):
    """The scores of one source, or their mean over sources.

    The mean has the sums of all counts, and the means of the ratios over the sources with vehicles.

    Attributes
    ----------
    images, vehicles
        Counts.
    ap50, ap50_95
        Average precision over all scores.
    best_f1, best_score
        The highest F1 at any score, and that score; 0 without vehicles or detections. The mean uses
        one score for all sources.
    """

    images: int
    vehicles: int
    ap50: float
    ap50_95: float
    best_f1: float
    best_score: float


@dataclass(frozen=True, eq=False)
class MeasuredSet:
    """The images of one source, labelled and measured."""

    labelled: LabelledImages
    images: Sequence[MeasuredImage]

    @cached_property
    def ranked(self) -> RankedPredictions:
        """The detections of every score."""
        return rank_predictions(pool([image.every for image in self.images]))

    @cached_property
    def scores(self) -> ImageScores:
        """The scores of the source."""
        detection = score_boxes(pool([image.shown for image in self.images]))
        ap50, ap50_95 = self.ranked.average_precisions()
        best, at_score = best_f1([self.ranked])
        return ImageScores(
            **vars(detection),
            images=len(self.images),
            vehicles=self.ranked.vehicles,
            ap50=ap50,
            ap50_95=ap50_95,
            best_f1=best,
            best_score=at_score,
        )


@dataclass(frozen=True, slots=True, eq=False)
class ImagesResult:
    """The measured sources, and the rule for which boxes count."""

    counting: Counting
    sources: tuple[MeasuredSet, ...]

    @property
    def mean(self) -> ImageScores:
        """The mean over the sources."""
        scores = [source.scores for source in self.sources]
        with_vehicles = [score for score in scores if score.vehicles] or scores
        means: dict[str, Any] = {}
        for name in (column.name for column in fields(ImageScores)):
            total = sum(getattr(score, name) for score in scores)
            ratios = [getattr(score, name) for score in with_vehicles]
            means[name] = total if isinstance(total, int) else fmean(ratios)
        best, at_score = best_f1([source.ranked for source in self.sources])
        return ImageScores(**means | {"best_f1": best, "best_score": at_score})

    @property
    def comparison(self) -> Comparison:
        """The vehicles and the detections that count, of all sources."""
        return pool([image.shown for source in self.sources for image in source.images])


def evaluate_images(
    sets: Sequence[LabelledImages],
    model: DetectorModel,
    counting: Counting,
    *,
    threads: int = 1,
    progress: Progress = no_progress,
) -> ImagesResult:
    """Search all images, each on its own, and score each set.

    Parameters
    ----------
    model
        A detector that returns detections of every score, or at least of `counting.score`.
    progress
        Called once, with the number of images, for the progress.

    Raises
    ------
    ImageError
        An image cannot be read or searched; the message names it.
    """
    advance = progress("", sum(len(set_.images) for set_ in sets))
    whole = ImageSearch(model, Settings())  # the whole image, without steps

    def search(labelled: LabelledImage) -> MeasuredImage:
        image = labelled.read()
        detections = whole.detect(labelled.path, image).detections
        return MeasuredImage.of(labelled, image.shape[1], detections, counting)

    sources = []
    for labelled in sets:
        measured = []
        with SearchThreads(threads) as pool:
            for _, result in pool.map_ordered(search, labelled.images):
                measured.append(result)
                advance(1)
        sources.append(MeasuredSet(labelled, measured))
    return ImagesResult(counting, tuple(sources))


def best_f1(sources: Sequence[RankedPredictions]) -> tuple[float, float]:
    """Return the highest mean F1 at any one score, and that score; 0 without vehicles."""
    sources = [ranked for ranked in sources if ranked.vehicles and len(ranked.scores)]
    if not sources:
        return 0.0, 0.0
    scores = np.unique(np.concatenate([ranked.scores for ranked in sources]))[::-1]
    means = np.mean([ranked.f1_at(scores) for ranked in sources], axis=0)
    return float(means.max()), float(scores[np.argmax(means)])


@dataclass(frozen=True, eq=False)
class ClipResult:
    """One video compared with its ground truth, or several videos pooled.

    `name` is shown in tables; `video` is the file, None if a file of tracks is scored. Frames up to
    `until`, counted from 1, are compared.
    """

    name: str
    comparison: Comparison
    until: int = 0
    video: Path | None = None

    @cached_property
    def scores(self) -> Scores:
        """All metrics."""
        return score_comparison(self.comparison)


def total(clips: Sequence[ClipResult]) -> ClipResult:
    """Return the pooled result of all videos."""
    return ClipResult("total", pool([clip.comparison for clip in clips]))


def score_files(
    prediction: Path, truth_path: Path, until: int | None = None, settings: Settings = _DEFAULT
) -> ClipResult:
    """Score a file of tracks against a file of ground truth.

    Parameters
    ----------
    until
        Number of the last frame to use, from 1; None: the last that the truth covers.
    settings
        For the classes to detect, and the roles of labels.

    Raises
    ------
    TruthError
        A file cannot be used.
    """
    tracks = read_tracks(prediction)
    for finding in warnings_in(tracks.findings):
        _log.warning("%s: %s", prediction, finding)
    truth = read_truth(truth_path, Roles.from_settings(settings))
    end = until or truth.length
    return ClipResult(str(prediction), compare(tracks.until(end), truth.until(end)), end)


def evaluate_video(
    video: Path,
    truth: SavedTracks,
    settings: Settings,
    model: DetectorModel,
    *,
    progress: Progress = no_progress,
    until: int | None = None,
) -> ClipResult:
    """Find the vehicles in a video with `vdet.run.video.Results`, and score them.

    True vehicles outside the regions are ignored.

    Parameters
    ----------
    truth
        Its ground truth; later frames are not read.
    model
        The detector of the settings.
    progress
        Called once, for the progress.
    until
        Number of the last frame to use, from 1; None: the last that the truth covers.

    Raises
    ------
    VideoError
        The video cannot be read or searched.
    TruthError
        The truth covers frames beyond the end of the video.
    """
    all_classes = settings.model_copy(update={"classes": ()})
    run = Run(video, settings=all_classes, frames=until or truth.length or None)
    shown, frames = dict[int, list[Track]](), 0
    truth = truth.until(until) if until else truth
    with Results(run, Parts(model), with_traffic=False) as results:
        advance, info = progress("", results.reader.expected), results.reader.info
        for result in results:
            tracks = [replace(track, box=track.box.rounded) for track in result.tracks]
            shown |= {result.frame.index: tracks} if tracks else {}
            frames += 1
            advance(1)
    truth.check_end(video, frames)
    truth = truth.until(frames)
    if settings.regions:
        regions = Regions(settings.regions, info.width, info.height)
        true_frames = {
            index: [
                replace(track, ignored=track.ignored or not regions.contains(track.foot))
                for track in tracks
            ]
            for index, tracks in truth.frames.items()
        }
        truth = replace(truth, frames=true_frames)
    comparison = compare(SavedTracks(shown), truth)
    return ClipResult(str(video), comparison, frames, video)

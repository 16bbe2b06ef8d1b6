"""Scores of a detector in labelled pictures: at one score, at every score, and by size."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from vdet.boxes import BoolArray, Boxes, Float64Array, Int64Array
from vdet.config.schema import Settings
from vdet.detect.protocol import DetectorModel
from vdet.evaluate.comparison import Comparison, MatchedFrame, compare, match, pool
from vdet.evaluate.detection_metrics import (
    RankedPredictions,
    detection_metrics,
    rank_predictions,
    ratio,
)
from vdet.labels.label import MAX_IN_FRAME
from vdet.labels.pictures import LabelledPicture, LabelledPictures
from vdet.labels.video import LabelledVideo
from vdet.progress import Progress, no_progress
from vdet.run.pictures import detect_picture
from vdet.run.threads import map_ordered

SIZES = (0.03, 0.06, 0.12)
"""Where the classes of width begin and end, shares of the picture's width."""
SIZE_NAMES = ("<3 %", "3–6 %", "6–12 %", ">12 %")


@dataclass(frozen=True, slots=True)
class Counting:
    """What counts.

    Attributes
    ----------
    score
        Detections with at least this score count.
    least_width
        Vehicles narrower than this share of the picture's width are ignore regions, and narrower
        detections count only if they find a vehicle.
    """

    score: float
    least_width: float


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredImage:
    """A searched picture as a video of one frame: its vehicles, and detections of every score."""

    picture: LabelledPicture
    width: int
    truth: LabelledVideo
    found: LabelledVideo

    @staticmethod
    def of(
        picture: LabelledPicture, width: int, found: Boxes, counting: Counting
    ) -> "MeasuredImage":
        """Mark what is an ignore region, and which detections need not find anything.

        Parameters
        ----------
        width
            Width of the picture, pixels.
        """
        least = counting.least_width * width
        regions = picture.ignored | (_widths(picture.boxes) < least)
        best = np.argsort(-found.scores, kind="stable")[:MAX_IN_FRAME]
        boxes = found.sides[best]
        return MeasuredImage(
            picture,
            width,
            _one_frame(picture.boxes, np.ones(len(regions)), regions),
            _one_frame(boxes, found.scores[best], _widths(boxes) < least),
        )

    def compare(self, score: float) -> Comparison:
        """Compare the detections of at least this score with the vehicles."""
        return compare(self.found.where(self.found.scores >= score), self.truth)


@dataclass(frozen=True, slots=True)
class SizeScores:
    """Of the vehicles of one size: counts and ratios; a ratio is None without vehicles.

    A false positive has the size of its own box.
    """

    vehicles: int
    matches: int
    false_positives: int
    recall: float | None
    f1: float | None


@dataclass(frozen=True, slots=True)
class ImageScores:
    """The scores of one source, or their mean over sources.

    The mean has the sums of all counts, and the means of the ratios over the sources with vehicles.
    Ratios are None where there are no vehicles.

    Attributes
    ----------
    images, vehicles, matches, false_positives
        Counts, at the score that is shown.
    precision, recall, f1, mean_iou
        At that score and IoU 0.5.
    ap50, ap50_95
        Average precision over all scores.
    best_f1, best_score
        The highest F1 that any score gives, and that score; of the mean, one score for all.
    sizes
        In the order of `SIZE_NAMES`.
    """

    images: int
    vehicles: int
    matches: int
    false_positives: int
    precision: float | None
    recall: float | None
    f1: float | None
    mean_iou: float | None
    ap50: float | None
    ap50_95: float | None
    best_f1: float | None
    best_score: float | None
    sizes: tuple[SizeScores, ...]


_COUNTS = ("images", "vehicles", "matches", "false_positives")
_RATIOS = ("precision", "recall", "f1", "mean_iou", "ap50", "ap50_95")


@dataclass(frozen=True, slots=True, eq=False)
class F1Curve:
    """F1 at every score: scores descending, float64 `(n,)`, and F1, float64 `(n,)`.

    Detections are taken by descending score, as for the average precision.
    """

    scores: Float64Array
    f1: Float64Array

    @staticmethod
    def of(ranked: RankedPredictions) -> "F1Curve":
        """Return the curve; without a point where there are no vehicles."""
        scores, count = ranked.scores, len(ranked.scores)
        f1 = 2 * np.cumsum(ranked.right[0]) / (np.arange(1, count + 1) + ranked.vehicles)
        last = np.append(scores[1:] != scores[:-1], True)[:count]  # of each score
        last &= ranked.vehicles > 0
        return F1Curve(scores[last], f1[last])

    def at(self, scores: Float64Array) -> Float64Array:
        """Return F1 where detections with at least each of these scores count."""
        rows = np.searchsorted(-self.scores, -scores, side="right")
        return np.concatenate([[0.0], self.f1])[rows]


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """The pictures of one source, as labelled and as measured, their curve and their scores."""

    labelled: LabelledPictures
    images: tuple[MeasuredImage, ...]
    curve: F1Curve
    scores: ImageScores


@dataclass(frozen=True, slots=True, eq=False)
class ImagesResult:
    """What counted, the sources of pictures with their scores, and the mean of these."""

    counting: Counting
    sources: tuple[Source, ...]
    mean: ImageScores


def evaluate_images(
    sets: Sequence[LabelledPictures],
    model: DetectorModel,
    counting: Counting,
    *,
    threads: int = 1,
    progress: Progress = no_progress,
) -> ImagesResult:
    """Search all pictures, each on its own, and score each set.

    Parameters
    ----------
    model
        A detector that shows detections of every score, or at least those of `counting.score`.
    progress
        Called with the number of pictures; what it returns is called with 1 for each.

    Raises
    ------
    ImageError
        A picture cannot be read or searched; the message names it.
    """
    advance = progress(sum(len(each.pictures) for each in sets))

    settings = Settings()  # the whole picture, and no step

    def search(labelled: LabelledPicture) -> MeasuredImage:
        image = labelled.read()
        found = detect_picture(labelled.path, image, model, settings).detections
        return MeasuredImage.of(labelled, image.shape[1], found, counting)

    sources = []
    for each in sets:
        measured = []
        with map_ordered(search, each.pictures, threads) as results:
            for _, result in results:
                measured.append(result)
                advance(1)
        sources.append(score_source(each, measured, counting))
    return ImagesResult(counting, tuple(sources), mean_scores(sources, counting))


def score_source(
    labelled: LabelledPictures, images: Sequence[MeasuredImage], counting: Counting
) -> Source:
    """Return the scores of one source."""
    shown = [image.compare(counting.score) for image in images]
    matched = [match(comparison) for comparison in shown]
    metrics = detection_metrics(pool(shown), [frame for frames in matched for frame in frames])
    ranked = rank_predictions(pool([image.compare(0) for image in images]))
    precisions = ranked.average_precisions()
    values = asdict(metrics) | {"ap50": float(precisions[0]), "ap50_95": float(precisions.mean())}
    curve = F1Curve.of(ranked)
    best_f1, best_score = _best([images], [curve], counting.score)
    scores = ImageScores(
        images=len(images),
        vehicles=ranked.vehicles,
        matches=metrics.matches,
        false_positives=metrics.false_positives,
        best_f1=best_f1,
        best_score=best_score,
        sizes=_by_size(images, matched),
        **{name: values[name] if ranked.vehicles else None for name in _RATIOS},
    )
    return Source(labelled, tuple(images), curve, scores)


def mean_scores(sources: Sequence[Source], counting: Counting) -> ImageScores:
    """Return the mean over sources."""
    scores = [source.scores for source in sources]
    counted = [source for source in sources if source.scores.vehicles]
    best_f1, best_score = _best(
        [source.images for source in counted], [source.curve for source in counted], counting.score
    )
    sizes = zip(*(each.sizes for each in scores), strict=True)
    return ImageScores(
        best_f1=best_f1,
        best_score=best_score,
        sizes=tuple(SizeScores(**_mean(column, SizeScores.__slots__)) for column in sizes),
        **_mean(scores, (*_COUNTS, *_RATIOS)),
    )


def _best(
    sources: Sequence[Sequence[MeasuredImage]], curves: Sequence[F1Curve], shown: float
) -> tuple[float | None, float | None]:
    """Return the highest mean F1 at any one score, and that score; None without vehicles.

    The curves choose the score. F1 there is measured as at the score `shown`, which is taken if it
    is better: a curve can differ a little where vehicles overlap.
    """
    scores = np.unique(np.concatenate([np.empty(0), *(curve.scores for curve in curves)]))[::-1]
    if not len(scores):
        return None, None
    means = np.mean([curve.at(scores) for curve in curves], axis=0)
    chosen = float(scores[np.argmax(means)])
    exact = {
        score: np.mean([_f1(images, score) for images in sources]) for score in (chosen, shown)
    }
    best = max(exact, key=lambda score: exact[score])
    return float(exact[best]), best


def _f1(images: Sequence[MeasuredImage], score: float) -> float:
    comparisons = [image.compare(score) for image in images]
    matches = sum(len(pairs) for each in comparisons for pairs in match(each))
    boxes = sum(each.vehicle_lengths().sum() + each.track_lengths().sum() for each in comparisons)
    return ratio(2 * matches, boxes)


def _one_frame(boxes: Float64Array, scores: Float64Array, ignored: BoolArray) -> LabelledVideo:
    count = len(boxes)
    return LabelledVideo(np.ones(count, np.int64), np.arange(count), boxes, scores, ignored, 1)


def _widths(boxes: Float64Array) -> Float64Array:
    return np.asarray(boxes[:, 2] - boxes[:, 0])


def _by_size(
    images: Sequence[MeasuredImage], matched: Sequence[Sequence[MatchedFrame]]
) -> tuple[SizeScores, ...]:
    counts = np.zeros((3, len(SIZE_NAMES)), np.int64)  # vehicles, matches, false positives
    for image, frames in zip(images, matched, strict=True):
        width = image.width
        for pairs in frames:
            vehicles = _sizes(pairs.frame.vehicle_boxes, width)
            wrong = np.delete(pairs.frame.track_boxes, pairs.track_rows, axis=0)
            groups = (vehicles, vehicles[pairs.vehicle_rows], _sizes(wrong, width))
            counts += [np.bincount(sizes, minlength=len(SIZE_NAMES)) for sizes in groups]
    return tuple(_size_scores(*column) for column in counts.T.tolist())


def _sizes(boxes: Float64Array, width: int) -> Int64Array:
    """Return the index into `SIZE_NAMES` of each box."""
    return np.searchsorted(SIZES, _widths(boxes) / width, side="right").astype(np.int64)


def _size_scores(vehicles: int, matches: int, wrong: int) -> SizeScores:
    if not vehicles:
        return SizeScores(0, 0, wrong, None, None)
    f1 = ratio(2 * matches, matches + wrong + vehicles)
    return SizeScores(vehicles, matches, wrong, ratio(matches, vehicles), f1)


def _mean(scores: Sequence[Any], names: Iterable[str]) -> dict[str, Any]:
    """Return the sum of each count and the mean of each ratio that is known."""
    return {name: _total([getattr(each, name) for each in scores]) for name in names}


def _total(values: Sequence[int | float | None]) -> float | None:
    known = [value for value in values if value is not None]
    if not known:
        return None
    return sum(known) if isinstance(known[0], int) else sum(known) / len(known)

"""Scores of a detector in labelled pictures: at one score, at every score, and by size."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self, TypeVar

import numpy as np

from vdet.boxes import BoolArray, Boxes, Float64Array
from vdet.config.schema import Settings
from vdet.detect.classes import OUR_NAMES
from vdet.detect.protocol import DetectorModel
from vdet.evaluate.average_precision import RankedPredictions, rank_predictions
from vdet.evaluate.comparison import Comparison, compare, pool
from vdet.evaluate.scores import ratio, score_detections
from vdet.labels.label import MAX_IN_FRAME
from vdet.labels.pictures import LabelledPicture, LabelledPictures
from vdet.labels.video import LabelledVideo
from vdet.progress import Progress, no_progress
from vdet.run.pictures import PictureSearch
from vdet.run.threads import map_ordered

SIZES = (0.03, 0.06, 0.12)
"""The limits between the classes of width, as shares of the picture's width."""
SIZE_NAMES = ("<3 %", "3–6 %", "6–12 %", ">12 %")


@dataclass(frozen=True, slots=True)
class Counting:
    """The rule that says which boxes count.

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
    """A searched picture, compared with its labels as a video of one frame.

    Attributes
    ----------
    width
        Width of the picture, pixels.
    regions
        float64 `(n, 4)`: x1, y1, x2, y2 of the ignore regions.
    every, shown
        The vehicles beside the detections of every score, and beside those that count.
    named
        The class of each detection by its id in `shown`; None if it is not known.
    """

    picture: LabelledPicture
    width: int
    regions: Float64Array
    every: Comparison
    shown: Comparison
    named: Sequence[str | None]

    @classmethod
    def of(cls, picture: LabelledPicture, width: int, found: Boxes, counting: Counting) -> Self:
        """Compare the detections with the labels of a picture that is `width` pixels wide."""
        least = counting.least_width * width
        regions = picture.ignored | (_widths(picture.boxes) < least)
        truth = _one_frame(picture.boxes, np.ones(len(regions)), regions)
        labelled = [name not in picture.unlabelled for name in found.class_names]
        found = found[np.flatnonzero(labelled)]
        found = found[np.argsort(-found.scores, kind="stable")[:MAX_IN_FRAME]]
        boxes, scores = found.sides, found.scores
        detected = _one_frame(boxes, scores, _widths(boxes) < least)
        shown = detected.where(scores >= counting.score)
        comparisons = compare(detected, truth), compare(shown, truth)
        return cls(picture, width, picture.boxes[regions], *comparisons, found.class_names)

    def class_pairs(self) -> Iterator[tuple[str | None, str | None]]:
        """Yield the class of each vehicle and of the detection that finds it; None for neither."""
        for frame in self.shown.frames:
            true = np.array(self.picture.classes, object)[self.shown.vehicle_ids[frame.vehicles]]
            named = np.array(self.named, object)[self.shown.track_ids[frame.tracks]]
            yield from zip(true[frame.rows], named[frame.columns], strict=True)
            yield from ((name, None) for name in np.delete(true, frame.rows))
            yield from ((None, name) for name in np.delete(named, frame.columns))


def _one_frame(boxes: Float64Array, scores: Float64Array, ignored: BoolArray) -> LabelledVideo:
    count = len(boxes)
    return LabelledVideo(np.ones(count, np.int64), np.arange(count), boxes, scores, ignored, 1)


def _widths(boxes: Float64Array) -> Float64Array:
    return np.asarray(boxes[:, 2] - boxes[:, 0])


@dataclass(frozen=True, slots=True)
class SizeScores:
    """Counts and ratios of the vehicles of one size; a ratio is None without vehicles.

    A false positive has the size of its own box. `width` is one of `SIZE_NAMES`.
    """

    width: str
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


@dataclass(frozen=True, slots=True)
class ClassResult:
    """How well the vehicles of one class are found and named, in the pictures of all sets.

    Attributes
    ----------
    precision, recall, f1
        Of detections that name the class; those that find a vehicle of unknown kind are left out.
    named
        The number of vehicles that are found, by the class of their detections.
    """

    name: str
    vehicles: int
    precision: float
    recall: float
    f1: float
    named: dict[str, int]


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredSet:
    """The pictures of one source, as labelled and as measured, all detections, and the scores."""

    labelled: LabelledPictures
    images: tuple[MeasuredImage, ...]
    ranked: RankedPredictions
    scores: ImageScores


@dataclass(frozen=True, slots=True, eq=False)
class ImagesResult:
    """The sources of pictures with their scores, and the rule for counting."""

    counting: Counting
    sources: tuple[MeasuredSet, ...]

    @property
    def mean(self) -> ImageScores:
        """The mean over the sources."""
        scores = [source.scores for source in self.sources]
        columns = zip(SIZE_NAMES, *(each.sizes for each in scores), strict=True)
        sizes = tuple(_mean(column, width=name) for name, *column in columns)
        best_f1, best_score = _best([source.ranked for source in self.sources])
        return _mean(scores, best_f1=best_f1, best_score=best_score, sizes=sizes)

    def classes(self) -> Iterator[ClassResult]:
        """Yield the scores of each class that has vehicles; none if detections have no class."""
        images = (image for source in self.sources for image in source.images)
        pairs = Counter(pair for image in images for pair in image.class_pairs())
        names = [name for name in OUR_NAMES if any(named == name for _, named in pairs)]
        known = OUR_NAMES[:-1]
        for name in known if names else ():
            counts = {each: pairs[name, each] for each in names}
            right, vehicles = pairs[name, name], pairs[name, None] + sum(counts.values())
            shown = sum(pairs[true, name] for true in (*known, None))
            if vehicles:
                f1 = ratio(2 * right, shown + vehicles)
                ratios = ratio(right, shown), ratio(right, vehicles), f1
                yield ClassResult(name, vehicles, *ratios, counts)


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
    whole = PictureSearch(model, Settings())  # the whole picture, and no step

    def search(labelled: LabelledPicture) -> MeasuredImage:
        image = labelled.read()
        found = whole.detect(labelled.path, image).detections
        return MeasuredImage.of(labelled, image.shape[1], found, counting)

    sources = []
    for each in sets:
        measured = []
        with map_ordered(search, each.pictures, threads) as results:
            for _, result in results:
                measured.append(result)
                advance(1)
        sources.append(score_source(each, measured))
    return ImagesResult(counting, tuple(sources))


def score_source(labelled: LabelledPictures, images: Sequence[MeasuredImage]) -> MeasuredSet:
    """Return the scores of one source."""
    found = score_detections(pool([image.shown for image in images]))
    ranked = rank_predictions(pool([image.every for image in images]))
    counts = len(images), ranked.vehicles, found.matches, found.false_positives
    ratios = found.precision, found.recall, found.f1, found.mean_iou, *ranked.average_precisions()
    scores = ImageScores(*counts, *ratios, *_best([ranked]), _by_size(images))
    unknown: dict[str, Any] = {} if ranked.vehicles else dict.fromkeys(_RATIOS)
    return MeasuredSet(labelled, tuple(images), ranked, replace(scores, **unknown))


_RATIOS = ("precision", "recall", "f1", "mean_iou", "ap50", "ap50_95")
_Scores = TypeVar("_Scores", ImageScores, SizeScores)


def _mean(scores: Sequence[_Scores], **given: Any) -> _Scores:
    """Return the sum of each count and the mean of each ratio that is known, and what is given."""
    means = dict(given)
    for name in (field.name for field in fields(scores[0]) if field.name not in given):
        known = [value for each in scores if (value := getattr(each, name)) is not None]
        total = sum(known)
        means[name] = (total if isinstance(total, int) else total / len(known)) if known else None
    return type(scores[0])(**means)


def _best(sources: Sequence[RankedPredictions]) -> tuple[float | None, float | None]:
    """Return the highest mean F1 at any one score, and that score; None without vehicles."""
    known = [ranked for ranked in sources if ranked.vehicles and len(ranked.scores)]
    if not known:
        return None, None
    scores = np.unique(np.concatenate([ranked.scores for ranked in known]))[::-1]
    means = np.mean([ranked.f1_at(scores) for ranked in known], axis=0)
    return float(means.max()), float(scores[np.argmax(means)])


def _by_size(images: Sequence[MeasuredImage]) -> tuple[SizeScores, ...]:
    counts = np.zeros((3, len(SIZE_NAMES)), np.int64)  # of vehicles, matches, false positives
    for image in images:
        for frame in image.shown.frames:
            vehicles = _widths(frame.vehicle_boxes) / image.width
            wrong = _widths(np.delete(frame.track_boxes, frame.columns, axis=0)) / image.width
            kinds = vehicles, vehicles[frame.rows], wrong
            counts += [np.histogram(widths, (0, *SIZES, np.inf))[0] for widths in kinds]
    found = []
    for name, (count, matches, alarms) in zip(SIZE_NAMES, counts.T.tolist(), strict=True):
        ratios = ratio(matches, count), ratio(2 * matches, matches + alarms + count)
        found.append(SizeScores(name, count, matches, alarms, *(ratios if count else (None, None))))
    return tuple(found)

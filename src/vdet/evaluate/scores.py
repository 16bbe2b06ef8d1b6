"""Ground truth and predictions, paired frame by frame, and all metrics of them.

Ignore regions are applied here, by one rule for all metrics. In every frame, predictions are first
paired with the vehicles that count (IoU at least 0.5, maximum sum of IoU). An unpaired prediction
is dropped, as neither right nor wrong, if at least half of its area is in a single ignore region,
or if it is `ignored` itself. The ignore regions are dropped too: they need not be found.

Sources: for ignore regions, the treatment of DontCare by the KITTI tracking benchmark, and of
crowds by COCO at IoU 0.5; for the metrics of tracks, Bernardin and Stiefelhagen, "Evaluating
Multiple Object Tracking Performance: The CLEAR MOT Metrics", 2008; Ristani et al., "Performance
Measures and a Data Set for Multi-Target, Multi-Camera Tracking", 2016; Luiten et al., "HOTA: A
Higher Order Metric for Evaluating Multi-Object Tracking", 2020.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, compress
from statistics import fmean

import numpy as np

from vdet.boxes import BoolArray, Float64Array, Int64Array, coverage, iou_matrix
from vdet.config.classes import STANDARD_CLASSES, UNKNOWN
from vdet.labels.label import Frames, SavedTracks, boxes_of
from vdet.track.track import Track

MATCH_IOU = 0.5
"""A prediction with at least this overlap finds a vehicle."""

UNMATCHED = -1
"""Partner of a vehicle without a track."""

_IGNORED_FRACTION = 0.5
_KEEP_BONUS = 1000.0  # larger than any sum of overlaps

IOU_THRESHOLDS = np.linspace(0.5, 0.95, 10)

_RECALLS = np.linspace(0, 1, 101)

_Pair = tuple[str | None, str | None]
"""The classes of a vehicle and of its track. None: missed, or a false alarm."""

ALPHAS = np.arange(0.05, 0.99, 0.05)
"""The overlap thresholds of HOTA, 0.05 … 0.95; the metrics are the mean over them."""


@dataclass(frozen=True, slots=True, eq=False)
class ComparedFrame:
    """The vehicles and predictions that count in a frame, and their pairs.

    Attributes
    ----------
    number
        Number of the frame, from 0.
    vehicles, tracks
        int64 `(n,)` and `(m,)`: the true vehicle and the predicted track of each box, as indices
        into `vehicle_ids` and `track_ids` of the `Comparison`.
    vehicle_boxes, track_boxes
        float64 `(n, 4)` and `(m, 4)`: x1, y1, x2, y2 in full-frame pixels.
    scores
        float64 `(m,)`: confidence of the predictions.
    iou
        float64 `(n, m)`.
    rows, columns
        int64 `(k,)` each: box `rows[i]` of the vehicles is found by box `columns[i]` of the tracks.
    """

    number: int
    vehicles: Int64Array
    tracks: Int64Array
    vehicle_boxes: Float64Array
    track_boxes: Float64Array
    scores: Float64Array
    iou: Float64Array
    rows: Int64Array
    columns: Int64Array

    @property
    def paired_vehicles(self) -> Int64Array:
        """The vehicles that are found, int64 `(k,)`: indices as in `vehicles`."""
        return self.vehicles[self.rows]

    @property
    def pairing_tracks(self) -> Int64Array:
        """The track that finds each of `paired_vehicles`, int64 `(k,)`."""
        return self.tracks[self.columns]


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """The frames of a video that have a vehicle or a prediction, in order.

    Attributes
    ----------
    frames
        The frames of pooled videos follow one another.
    vehicle_ids, track_ids
        int64: the id in its file of every vehicle and track with a box in `frames`.
    vehicle_names, track_names
        The class of each of these, "vehicle" if unknown.
    """

    frames: tuple[ComparedFrame, ...]
    vehicle_ids: Int64Array
    track_ids: Int64Array
    vehicle_names: tuple[str, ...]
    track_names: tuple[str, ...]

    def vehicle_lengths(self) -> Int64Array:
        """Return the number of boxes of every vehicle, int64."""
        return counts((frame.vehicles for frame in self.frames), len(self.vehicle_ids))

    def track_lengths(self) -> Int64Array:
        """Return the number of boxes of every track, int64."""
        return counts((frame.tracks for frame in self.frames), len(self.track_ids))

    def false_tracks(self) -> Int64Array:
        """Return the tracks with more than half of their boxes unmatched, int64.

        Boxes dropped for an ignore region do not count: a track without other boxes is not false.
        """
        right = counts((frame.pairing_tracks for frame in self.frames), len(self.track_ids))
        return np.flatnonzero(2 * right < self.track_lengths())


def compare(prediction: SavedTracks, truth: SavedTracks) -> Comparison:
    """Compare predictions with the truth of the same video, as `compare_frames` does.

    Predictions in frames that the truth does not cover are omitted. If it covers only the beginning
    of the video, cut the predictions with `until` first; otherwise all later ones are false alarms.
    """
    return compare_frames(prediction.named_frames(), truth.named_frames(), truth.covered)


def compare_frames(
    prediction: Frames, truth: Frames, covered: Sequence[int] | None = None
) -> Comparison:
    """Compare predictions with the truth: apply ignore regions and pair boxes.

    Boxes are paired at IoU 0.5 and above. A pair of the previous frame stays together if it still
    overlaps enough; the others are paired to maximize the sum of IoU. As in TrackEval, a frame
    without vehicles or predictions does not count as the previous frame.
    Source: Bernardin and Stiefelhagen, "Evaluating Multiple Object Tracking Performance: The CLEAR
    MOT Metrics", 2008.

    Parameters
    ----------
    covered
        The frames that the truth covers, from 0; None: all.
    """
    labelled = prediction.keys() if covered is None else set(covered)
    numbers = sorted((prediction.keys() & labelled) | truth.keys())
    counting = [_counting(prediction.get(n, ()), truth.get(n, ())) for n in numbers]
    vehicle_ids = _ids(vehicle for vehicles, _ in counting for vehicle in vehicles)
    track_ids = _ids(track for _, tracks in counting for track in tracks)
    partners = np.full(len(vehicle_ids), UNMATCHED)
    frames = []
    for number, (vehicles, tracks) in zip(numbers, counting, strict=True):
        if vehicles or tracks:
            of_vehicles = np.searchsorted(vehicle_ids, [vehicle.id for vehicle in vehicles])
            of_tracks = np.searchsorted(track_ids, [track.id for track in tracks])
            vehicle_boxes, track_boxes = boxes_of(vehicles), boxes_of(tracks)
            iou = iou_matrix(vehicle_boxes, track_boxes)
            together = partners[of_vehicles][:, np.newaxis] == of_tracks
            weights = np.where(at_least(iou, MATCH_IOU), iou + _KEEP_BONUS * together, 0)
            rows, columns = assign(weights)
            frame = ComparedFrame(
                number=number,
                vehicles=of_vehicles,
                tracks=of_tracks,
                vehicle_boxes=vehicle_boxes,
                track_boxes=track_boxes,
                scores=np.array([track.score for track in tracks], np.float64),
                iou=iou,
                rows=rows,
                columns=columns,
            )
            frames.append(frame)
            if iou.size:
                partners[:] = UNMATCHED
                partners[frame.paired_vehicles] = frame.pairing_tracks
    true_tracks = (track for tracks in truth.values() for track in tracks if not track.ignored)
    return Comparison(
        frames=tuple(frames),
        vehicle_ids=vehicle_ids,
        track_ids=track_ids,
        vehicle_names=_names(vehicle_ids, true_tracks),
        track_names=_names(track_ids, chain.from_iterable(prediction.values())),
    )


def pool(comparisons: Sequence[Comparison]) -> Comparison:
    """Join the comparisons of several videos; the scores of the result are their total.

    The same id in two videos means two vehicles or tracks.
    """
    frames: list[ComparedFrame] = []
    vehicles = tracks = 0
    for video in comparisons:
        frames += [
            replace(frame, vehicles=frame.vehicles + vehicles, tracks=frame.tracks + tracks)
            for frame in video.frames
        ]
        vehicles += len(video.vehicle_ids)
        tracks += len(video.track_ids)
    return Comparison(
        frames=tuple(frames),
        vehicle_ids=joined(video.vehicle_ids for video in comparisons),
        track_ids=joined(video.track_ids for video in comparisons),
        vehicle_names=tuple(name for video in comparisons for name in video.vehicle_names),
        track_names=tuple(name for video in comparisons for name in video.track_names),
    )


def at_least(overlaps: Float64Array, threshold: float) -> BoolArray:
    """Return where `overlaps` reach `threshold`, up to rounding of float64."""
    return np.asarray(overlaps >= threshold - np.finfo(np.float64).eps)


def counts(indices: Iterable[Int64Array], length: int) -> Int64Array:
    """Return how often each of 0 … `length` - 1 occurs in all `indices` together, int64."""
    return np.bincount(joined(indices), minlength=length)


def joined(arrays: Iterable[Int64Array]) -> Int64Array:
    """Return one-dimensional arrays as one; an empty one if there are none."""
    return np.concatenate([np.empty(0, np.int64), *arrays])


def _counting(tracks: Sequence[Track], truth: Sequence[Track]) -> tuple[list[Track], list[Track]]:
    """Return the vehicles and the predictions of a frame that count."""
    vehicles = [track for track in truth if not track.ignored]
    regions, boxes = boxes_of(track for track in truth if track.ignored), boxes_of(tracks)
    iou = iou_matrix(boxes_of(vehicles), boxes)
    _, paired = assign(np.where(at_least(iou, MATCH_IOU), iou, 0))
    counts = np.array([not track.ignored for track in tracks], np.bool_)
    counts &= ~at_least(coverage(boxes, regions), _IGNORED_FRACTION).any(axis=1)
    counts[paired] = True
    return vehicles, list(compress(tracks, counts))


def assign(values: Float64Array) -> tuple[Int64Array, Int64Array]:
    """Pair rows with columns, each at most once, to maximize the sum of the values, `(n, m)`.

    Returns the rows, ascending, and the columns of the pairs with a value above 0.
    """
    from scipy.optimize import linear_sum_assignment  # a run does without it

    rows, columns = linear_sum_assignment(values, maximize=True)
    is_pair = values[rows, columns] > 0
    return rows[is_pair], columns[is_pair]


def _ids(tracks: Iterable[Track]) -> Int64Array:
    """Return the ids of tracks, each once, ascending."""
    return np.unique(np.array([track.id for track in tracks], np.int64))


def _names(ids: Int64Array, tracks: Iterable[Track]) -> tuple[str, ...]:
    """Return the last class of each id in the tracks."""
    names = {track.id: track.class_name for track in tracks if track.class_name}
    return tuple(names.get(id_, UNKNOWN) for id_ in ids.tolist())


@dataclass(frozen=True)
class DetectionScores:
    """Counts of boxes over all frames and their ratios, 0 to 1; 0 if there is nothing to divide by.

    `matches` are true boxes found at IoU 0.5, `false_positives` predictions without a match,
    `misses` true boxes without a match. `mean_iou` is the mean over the matches.
    """

    matches: int
    false_positives: int
    misses: int
    precision: float
    recall: float
    f1: float
    mean_iou: float


@dataclass(frozen=True)
class Scores(DetectionScores):
    """All metrics of a video.

    A ratio is 0 if there is nothing to divide by.

    Attributes
    ----------
    ap50, ap50_95
        Average precision over the scores, at IoU 0.5, and as the mean over 0.5 to 0.95.
    mota
        1 - (misses + false positives + id switches) / true boxes; negative if there are more
        mistakes than true boxes.
    id_switches
        Matches of a vehicle by another track than in its last match, however long ago.
    fragmentations
        How often a vehicle is found again after it was missed or absent.
    idf1
        F1 of boxes if every vehicle has at most one track, 0 to 1.
    hota, deta, assa
        HOTA and its two factors, detection accuracy and association accuracy, 0 to 1.
    vehicles, vehicle_boxes, tracks, track_boxes
        Numbers without ignore regions and the predictions dropped for them.
    delays
        For every vehicle, frames from its appearance to its first match; None without a match.
    mean_delay
        Mean over the vehicles found; None if none was.
    false_tracks
        Number of tracks with more than half of their boxes unmatched.
    """

    ap50: float
    ap50_95: float
    mota: float
    id_switches: int
    fragmentations: int
    idf1: float
    hota: float
    deta: float
    assa: float
    vehicles: int
    vehicle_boxes: int
    tracks: int
    track_boxes: int
    delays: tuple[int | None, ...]
    mean_delay: float | None
    false_tracks: int


def score(prediction: SavedTracks, truth: SavedTracks) -> Scores:
    """Score the predictions for a video against its ground truth."""
    return score_comparison(compare(prediction, truth))


def score_boxes(comparison: Comparison) -> DetectionScores:
    """Score a comparison, ignoring ids and scores."""
    frames = comparison.frames
    vehicles = sum(len(frame.vehicles) for frame in frames)
    tracks = sum(len(frame.tracks) for frame in frames)
    matches = sum(len(frame.rows) for frame in frames)
    overlap = sum(float(frame.iou[frame.rows, frame.columns].sum()) for frame in frames)
    return DetectionScores(
        matches=matches,
        false_positives=tracks - matches,
        misses=vehicles - matches,
        precision=ratio(matches, tracks),
        recall=ratio(matches, vehicles),
        f1=ratio(2 * matches, tracks + vehicles),
        mean_iou=ratio(overlap, matches),
    )


def score_comparison(comparison: Comparison) -> Scores:
    """Score a comparison: one video, or several that `pool` has joined."""
    detection, delays = score_boxes(comparison), delays_of(comparison)
    of_found = [delay for delay in delays if delay is not None]
    boxes = detection.matches + detection.misses
    shown = detection.matches + detection.false_positives
    switches, agreeing = id_switches(comparison), identity_matches(comparison)
    right = detection.matches - detection.false_positives - switches
    ap50, ap50_95 = rank_predictions(comparison).average_precisions()
    hota, deta, assa = hota_of(comparison)
    return Scores(
        **vars(detection),
        ap50=ap50,
        ap50_95=ap50_95,
        mota=ratio(right, boxes),
        id_switches=switches,
        fragmentations=fragmentations(comparison),
        idf1=ratio(2 * agreeing, boxes + shown),
        hota=hota,
        deta=deta,
        assa=assa,
        vehicles=len(comparison.vehicle_ids),
        vehicle_boxes=boxes,
        tracks=len(comparison.track_ids),
        track_boxes=shown,
        delays=delays,
        mean_delay=fmean(of_found) if of_found else None,
        false_tracks=len(comparison.false_tracks()),
    )


def ratio(part: float, whole: float) -> float:
    """Return `part / whole`; 0 if `whole` is 0, as in TrackEval."""
    return float(part / whole) if whole else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class RankedPredictions:
    """All predictions by descending score, and which of them are right.

    Each one finds the vehicle in its frame that it overlaps most, among those not yet found by an
    earlier prediction. Equal scores are in the order of the frames, so that predictions without
    scores describe a single operating point.
    Source: the COCO detection evaluation (pycocotools).

    Attributes
    ----------
    scores
        float64 `(n,)`, descending.
    right
        bool `(10, n)`: whether each finds a vehicle, at each of `IOU_THRESHOLDS`.
    vehicles
        Number of true boxes.
    """

    scores: Float64Array
    right: BoolArray
    vehicles: int

    def average_precisions(self) -> tuple[float, float]:
        """Return the average precision at IoU 0.5, and its mean over `IOU_THRESHOLDS`, 0 to 1.

        It is the mean precision at the 101 recalls 0, 0.01 … 1; 0 without vehicles.
        """
        if not self.vehicles or not len(self.scores):
            return 0.0, 0.0
        precisions = [_average_precision(row, self.vehicles) for row in self.right]
        return precisions[0], float(np.mean(precisions))

    def f1_at(self, scores: Float64Array) -> Float64Array:
        """Return F1 at each of these score thresholds, float64 `(k,)`."""
        counted = np.searchsorted(-self.scores, -scores, side="right")
        right = np.concatenate([[0], np.cumsum(self.right[0])])[counted]
        return np.asarray(2 * right / np.maximum(1, counted + self.vehicles))


def rank_predictions(comparison: Comparison) -> RankedPredictions:
    """Sort the predictions by descending score, and mark those that are right."""
    none = np.zeros((len(IOU_THRESHOLDS), 0), np.bool_)
    frames = comparison.frames
    scores = np.concatenate([np.empty(0), *(np.sort(-frame.scores) for frame in frames)])
    right = np.concatenate([none, *map(_right_predictions, frames)], axis=1)
    order = np.argsort(scores, kind="stable")
    vehicles = sum(len(frame.vehicles) for frame in frames)
    return RankedPredictions(-scores[order], right[:, order], vehicles)


def _right_predictions(frame: ComparedFrame) -> BoolArray:
    """Return whether each prediction finds a vehicle, `(10, m)`: by threshold and score."""
    order = np.argsort(-frame.scores, kind="stable")
    right = np.zeros((len(IOU_THRESHOLDS), len(order)), np.bool_)
    overlaps = frame.iou[:, order]
    for row, threshold in zip(right, IOU_THRESHOLDS, strict=True):
        free = overlaps.copy()
        for column in np.flatnonzero(overlaps.max(axis=0, initial=0) >= threshold).tolist():
            best = len(free) - 1 - int(np.argmax(free[::-1, column]))  # the last of equals: COCO
            if free[best, column] >= threshold:
                row[column] = True
                free[best] = -1
    return right


def _average_precision(right: BoolArray, vehicles: int) -> float:
    matches = np.cumsum(right)
    recall = matches / vehicles
    precision = matches / np.arange(1, len(right) + 1)
    highest_from_here = np.maximum.accumulate(precision[::-1])[::-1]
    reached = np.searchsorted(recall, _RECALLS, side="left")
    return float(np.append(highest_from_here, 0)[reached].mean())


@dataclass(frozen=True, slots=True)
class ClassResult:
    """How well the vehicles of one class are found and classified.

    Attributes
    ----------
    vehicles, found, right
        Number of vehicles; of those found; of those found with this class.
    precision, recall, f1
        Of tracks with this class, without those that find a vehicle of unknown kind.
    named
        Number of found vehicles by the class of their tracks, the most frequent first.
    """

    name: str
    vehicles: int
    found: int
    right: int
    precision: float
    recall: float
    f1: float
    named: dict[str, int]

    @property
    def confused(self) -> str:
        """The other classes given to these vehicles, with their numbers."""
        return ", ".join(f"{name} {n}" for name, n in self.named.items() if name != self.name)


def class_results(comparison: Comparison) -> tuple[ClassResult, ...]:
    """Return a result for each class with vehicles; empty if no track has a class.

    A vehicle has the class of the track that finds it in most frames. A track with more than half
    of its boxes unmatched is a false alarm. An image counts as a video of one frame.
    """
    if not set(comparison.track_names) - {UNKNOWN}:
        return ()
    pairs = Counter(_pairs(comparison))
    names = set(comparison.vehicle_names) - {UNKNOWN}
    ordered = [name for name in STANDARD_CLASSES if name in names] + sorted(
        names - set(STANDARD_CLASSES)
    )
    return tuple(_result(name, pairs) for name in ordered)


def _pairs(comparison: Comparison) -> Iterator[_Pair]:
    together = Counter[tuple[int, int]]()
    for frame in comparison.frames:
        together.update(
            zip(frame.paired_vehicles.tolist(), frame.pairing_tracks.tolist(), strict=True)
        )
    names: dict[int, str] = {}
    for (vehicle, track), _ in together.most_common():
        names.setdefault(vehicle, comparison.track_names[track])
    for vehicle, name in enumerate(comparison.vehicle_names):
        yield name, names.get(vehicle)
    for track in comparison.false_tracks().tolist():
        yield None, comparison.track_names[track]


def _result(name: str, pairs: Counter[_Pair]) -> ClassResult:
    by_track = Counter({track: n for (vehicle, track), n in pairs.items() if vehicle == name})
    named = {track: n for track, n in by_track.most_common() if track}
    vehicles, right = by_track.total(), by_track[name]
    shown = sum(n for (vehicle, track), n in pairs.items() if track == name and vehicle != UNKNOWN)
    return ClassResult(
        name=name,
        vehicles=vehicles,
        found=sum(named.values()),
        right=right,
        precision=ratio(right, shown),
        recall=ratio(right, vehicles),
        f1=ratio(2 * right, shown + vehicles),
        named=named,
    )


def delays_of(comparison: Comparison) -> tuple[int | None, ...]:
    """Return the number of frames from the appearance of each vehicle to its first match.

    None: the vehicle is never found.
    """
    appears: dict[int, int] = {}
    first_match: dict[int, int] = {}
    for frame in reversed(comparison.frames):  # so the first frame is the one that stays
        appears |= dict.fromkeys(frame.vehicles.tolist(), frame.number)
        first_match |= dict.fromkeys(frame.paired_vehicles.tolist(), frame.number)
    return tuple(
        first_match[vehicle] - appears[vehicle] if vehicle in first_match else None
        for vehicle in sorted(appears)
    )


def id_switches(comparison: Comparison) -> int:
    """Return how often a vehicle is matched by another track than in its last match."""
    last = np.full(len(comparison.vehicle_ids), UNMATCHED)
    switches = 0
    for frame in comparison.frames:
        before = last[frame.paired_vehicles]
        switches += int(np.sum((before != UNMATCHED) & (before != frame.pairing_tracks)))
        last[frame.paired_vehicles] = frame.pairing_tracks
    return switches


def fragmentations(comparison: Comparison) -> int:
    """Return how often a vehicle is found again after it was missed or absent.

    As in TrackEval, frames without predictions are skipped: a gap of such frames does not count.
    """
    before = np.zeros(len(comparison.vehicle_ids), np.bool_)
    starts = np.zeros(len(comparison.vehicle_ids), np.int64)
    for frame in comparison.frames:
        if frame.iou.size:
            now = np.zeros_like(before)
            now[frame.paired_vehicles] = True
            starts += now & ~before
            before = now
    return int(np.maximum(starts - 1, 0).sum())


def identity_matches(comparison: Comparison) -> int:
    """Return how many boxes match at IoU 0.5 if each vehicle has at most one track.

    Whole vehicles are paired with whole tracks to maximize this number.
    """
    agreements = np.zeros((len(comparison.vehicle_ids), len(comparison.track_ids)))
    for frame in comparison.frames:
        rows, columns = np.nonzero(frame.iou >= MATCH_IOU)
        agreements[frame.vehicles[rows], frame.tracks[columns]] += 1
    return int(agreements[assign(agreements)].sum())


def hota_of(comparison: Comparison) -> tuple[float, float, float]:
    """Return HOTA, DetA and AssA, each the mean over `ALPHAS`, 0 to 1."""
    if not len(comparison.vehicle_ids) or not len(comparison.track_ids):
        return 0.0, 0.0, 0.0
    lengths = comparison.vehicle_lengths()[:, np.newaxis] + comparison.track_lengths()
    boxes = int(comparison.vehicle_lengths().sum() + comparison.track_lengths().sum())
    alignment = _alignment(comparison, lengths)
    pairs = []
    for frame in comparison.frames:
        aligned = alignment[np.ix_(frame.vehicles, frame.tracks)]
        rows, columns = assign(aligned * frame.iou)
        pairs.append((frame.vehicles[rows], frame.tracks[columns], frame.iou[rows, columns]))
    vehicles, tracks, iou = map(np.concatenate, zip(*pairs, strict=True))
    accuracies = []
    for alpha in ALPHAS:
        chosen = at_least(iou, alpha)
        together = np.zeros(lengths.shape)
        np.add.at(together, (vehicles[chosen], tracks[chosen]), 1)
        matches = int(np.count_nonzero(chosen))
        agreement = float(np.sum(together**2 / (lengths - together)))
        accuracies.append((matches / (boxes - matches), agreement / max(matches, 1)))
    deta, assa = np.mean(accuracies, axis=0)
    return float(np.sqrt(np.prod(accuracies, axis=1)).mean()), float(deta), float(assa)


def _alignment(comparison: Comparison, lengths: Int64Array) -> Float64Array:
    """Return how well vehicle and track agree over the whole video, `(vehicles, tracks)`."""
    shared = np.zeros(lengths.shape)
    for frame in comparison.frames:
        total = frame.iou.sum(axis=0) + frame.iou.sum(axis=1)[:, np.newaxis] - frame.iou
        part = np.divide(frame.iou, total, out=np.zeros_like(total), where=total > 0)
        shared[np.ix_(frame.vehicles, frame.tracks)] += part
    return shared / (lengths - shared)

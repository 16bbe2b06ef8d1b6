"""Ground truth and predictions paired frame by frame: the input of every metric.

Ignore regions are applied here, by one rule for all metrics. In every frame, predictions are first
paired with the vehicles that count (IoU at least 0.5, maximum sum of IoU). An unpaired prediction
is dropped, as neither right nor wrong, if at least half of its area is in a single ignore region,
or if it is `ignored` itself. The ignore regions are dropped too: they need not be found.

Source: the treatment of DontCare by the KITTI tracking benchmark, and of crowds by COCO at IoU 0.5.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, compress

import numpy as np

from vdet.boxes import BoolArray, Float64Array, Int64Array, coverage, iou_matrix
from vdet.config.classes import UNKNOWN
from vdet.labels.label import Label, SavedTracks, boxes_of

MATCH_IOU = 0.5
"""A prediction with at least this overlap finds a vehicle."""

UNMATCHED = -1
"""Partner of a vehicle without a track."""

_IGNORED_FRACTION = 0.5
_KEEP_BONUS = 1000.0  # larger than any sum of overlaps


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


Frames = Mapping[int, Sequence[Label]]
"""The labels of each frame by its number."""


def compare(prediction: SavedTracks, truth: SavedTracks) -> Comparison:
    """Compare predictions with the truth of the same video, as `compare_frames` does.

    Predictions in frames that the truth does not cover are omitted. If it covers only the beginning
    of the video, cut the predictions with `until` first; otherwise all later ones are false alarms.
    """
    return compare_frames(prediction.by_frame(), truth.by_frame(), truth.covered)


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
            of_vehicles = np.searchsorted(vehicle_ids, [vehicle.track.id for vehicle in vehicles])
            of_tracks = np.searchsorted(track_ids, [label.track.id for label in tracks])
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
                scores=np.array([label.track.score for label in tracks], np.float64),
                iou=iou,
                rows=rows,
                columns=columns,
            )
            frames.append(frame)
            if iou.size:
                partners[:] = UNMATCHED
                partners[frame.paired_vehicles] = frame.pairing_tracks
    true_labels = (label for labels in truth.values() for label in labels if not label.ignored)
    return Comparison(
        frames=tuple(frames),
        vehicle_ids=vehicle_ids,
        track_ids=track_ids,
        vehicle_names=_names(vehicle_ids, true_labels),
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


def _counting(tracks: Sequence[Label], truth: Sequence[Label]) -> tuple[list[Label], list[Label]]:
    """Return the vehicles and the predictions of a frame that count."""
    vehicles = [label for label in truth if not label.ignored]
    regions, boxes = boxes_of(label for label in truth if label.ignored), boxes_of(tracks)
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


def _ids(labels: Iterable[Label]) -> Int64Array:
    """Return the ids of labels, each once, ascending."""
    return np.unique(np.array([label.track.id for label in labels], np.int64))


def _names(ids: Int64Array, labels: Iterable[Label]) -> tuple[str, ...]:
    """Return the last class of each id in the labels."""
    names = {x.track.id: x.track.class_name for x in labels if x.track.class_name}
    return tuple(names.get(id_, UNKNOWN) for id_ in ids.tolist())

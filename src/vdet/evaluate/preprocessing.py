"""Truth and predictions made ready for the metrics, with ignore regions applied.

The rule, one for all metrics: in every frame the predictions are first paired with the vehicles
that count (IoU at least 0.5, largest sum of IoU). A prediction that is left over and has at least
half of its own area in a single ignore region is dropped: it is neither right nor wrong. The
ignore regions are dropped too: nobody has to find them.
Source: the KITTI tracking benchmark's treatment of DontCare; that of crowds in COCO at IoU 0.5.
"""

from collections.abc import Iterable

import numpy as np

from vdet.errors import TruthError
from vdet.evaluate.assignment import assign, at_least
from vdet.evaluate.comparison import ComparedFrame, Comparison, joined
from vdet.evaluate.labelled_video import Flags, Integers, LabelledVideo
from vdet.geometry import coverage, iou_matrix

MATCH_IOU = 0.5
"""From this overlap on a prediction finds a vehicle."""

MAX_IDS = 10_000
"""Vehicles, and tracks, of one video."""
MAX_IN_FRAME = 1000
"""Boxes of either in one frame."""
MAX_PAIRS = 25_000_000
"""Of a vehicle and a track; and of their boxes in one frame, summed over the frames."""

_IGNORED_SHARE = 0.5


def compare(
    prediction: LabelledVideo, truth: LabelledVideo, *, rate: float | None = None
) -> Comparison:
    """Put predictions beside the truth of the same video and apply the ignore regions.

    The video is taken to end with the last frame that either knows of. Where truth covers only a
    part of the video, cut the predictions with `until` first, or all beyond it are false alarms.

    Parameters
    ----------
    rate
        Frames a second; where it is not given, that of the predictions or the truth.

    Raises
    ------
    TruthError
        There are more than `MAX_IDS`, `MAX_IN_FRAME` or `MAX_PAIRS`, far beyond what a road shows.
    """
    _check_size(prediction, truth)
    numbers = np.union1d(prediction.frames, truth.frames).tolist()
    kept = [_kept(prediction.frame(number), truth.frame(number)) for number in numbers]
    vehicle_ids = _distinct(vehicles.ids for vehicles, _ in kept)
    track_ids = _distinct(tracks.ids for _, tracks in kept)
    frames = [
        ComparedFrame(
            number,
            np.searchsorted(vehicle_ids, vehicles.ids),
            np.searchsorted(track_ids, tracks.ids),
            vehicles.boxes,
            tracks.boxes,
            tracks.scores,
            iou_matrix(vehicles.boxes, tracks.boxes),
        )
        for number, (vehicles, tracks) in zip(numbers, kept, strict=True)
        if len(vehicles) or len(tracks)
    ]
    seconds = _seconds(prediction, truth, rate)
    return Comparison(tuple(frames), vehicle_ids, track_ids, seconds)


def _check_size(prediction: LabelledVideo, truth: LabelledVideo) -> None:
    """Refuse what would take hours and gigabytes to compare, before it does."""
    tracks, vehicles = (len(np.unique(each.ids)) for each in (prediction, truth))
    found, found_counts = np.unique(prediction.frames, return_counts=True)
    true, true_counts = np.unique(truth.frames, return_counts=True)
    _, in_found, in_true = np.intersect1d(found, true, return_indices=True)
    in_frames = int(np.sum(found_counts[in_found] * true_counts[in_true]))
    most = max(found_counts.max(initial=0), true_counts.max(initial=0))
    if (
        max(tracks, vehicles) > MAX_IDS
        or most > MAX_IN_FRAME
        or max(tracks * vehicles, in_frames) > MAX_PAIRS
    ):
        raise TruthError(
            f"{tracks:,} tracks with {len(prediction):,} boxes and {vehicles:,} vehicles with "
            f"{len(truth):,}, up to {most:,} in one frame, are too many to compare; cut the video "
            "into parts"
        )


def _kept(tracks: LabelledVideo, truth: LabelledVideo) -> tuple[LabelledVideo, LabelledVideo]:
    """Return the vehicles and the predictions of a frame that count."""
    vehicles, regions = truth.where(~truth.ignored), truth.where(truth.ignored)
    inside = at_least(coverage(tracks.boxes, regions.boxes), _IGNORED_SHARE).any(axis=1)
    return vehicles, tracks.where(_paired(vehicles, tracks) | ~inside)


def _paired(vehicles: LabelledVideo, tracks: LabelledVideo) -> Flags:
    iou = iou_matrix(vehicles.boxes, tracks.boxes)
    _, columns = assign(np.where(at_least(iou, MATCH_IOU), iou, 0))
    paired = np.zeros(len(tracks), np.bool_)
    paired[columns] = True
    return paired


def _distinct(ids: Iterable[Integers]) -> Integers:
    return np.unique(joined(ids))


def _seconds(prediction: LabelledVideo, truth: LabelledVideo, rate: float | None) -> float | None:
    rate = rate or prediction.rate or truth.rate
    last = max(prediction.last_frame, truth.last_frame)
    return last / rate if rate else None

"""How well vehicles are followed: CLEAR-MOT, identity metrics and HOTA.

Sources, with details as in TrackEval:
CLEAR-MOT: Bernardin and Stiefelhagen, "Evaluating Multiple Object Tracking Performance: The CLEAR
MOT Metrics", 2008. Identity: Ristani et al., "Performance Measures and a Data Set for Multi-Target,
Multi-Camera Tracking", 2016. HOTA: Luiten et al., "HOTA: A Higher Order Metric for Evaluating
Multi-Object Tracking", IJCV 2021.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vdet.boxes import Float64Array, Int64Array
from vdet.evaluate.comparison import (
    MATCH_IOU,
    UNMATCHED,
    Comparison,
    MatchedFrame,
    assign,
    at_least,
    counts,
    joined,
)
from vdet.evaluate.detection_metrics import ratio

ALPHAS = np.arange(0.05, 0.99, 0.05)
"""The overlap thresholds of HOTA, 0.05 … 0.95; the metrics are the mean over them."""

_MOSTLY_TRACKED = 0.8
_MOSTLY_LOST = 0.2


@dataclass(frozen=True)
class ClearMetrics:
    """The CLEAR-MOT metrics.

    Attributes
    ----------
    mota
        1 - (misses + false positives + id switches) / true boxes; negative if there are more
        mistakes than true boxes.
    motp
        Mean IoU of the matches: larger is better.
    id_switches
        Matches of a vehicle by another track than its last match, at any distance in time.
    fragmentations
        How often a vehicle is found again after it was missed or absent. As in TrackEval, frames
        without any prediction are skipped: a gap that consists of such frames does not count.
    mostly_tracked, partly_tracked, mostly_lost
        Vehicles found in more than 80 %, in 20 to 80 %, in less than 20 % of their boxes.
    """

    mota: float
    motp: float
    id_switches: int
    fragmentations: int
    mostly_tracked: int
    partly_tracked: int
    mostly_lost: int


def clear_metrics(comparison: Comparison, matched: Sequence[MatchedFrame]) -> ClearMetrics:
    """Return the CLEAR-MOT metrics; `matched` is `match(comparison)`."""
    vehicles = comparison.vehicle_lengths()
    matches = sum(len(frame) for frame in matched)
    false_positives = int(comparison.track_lengths().sum()) - matches
    switches = _id_switches(comparison, matched)
    found = counts((frame.vehicles for frame in matched), len(vehicles)) / vehicles
    return ClearMetrics(
        mota=ratio(matches - false_positives - switches, int(vehicles.sum())),
        motp=ratio(sum(float(frame.iou.sum()) for frame in matched), matches),
        id_switches=switches,
        fragmentations=_fragmentations(comparison, matched),
        mostly_tracked=int(np.sum(found > _MOSTLY_TRACKED)),
        partly_tracked=int(np.sum((found >= _MOSTLY_LOST) & (found <= _MOSTLY_TRACKED))),
        mostly_lost=int(np.sum(found < _MOSTLY_LOST)),
    )


def _id_switches(comparison: Comparison, matched: Sequence[MatchedFrame]) -> int:
    last = np.full(len(comparison.vehicle_ids), UNMATCHED)
    switches = 0
    for frame in matched:
        before = last[frame.vehicles]
        switches += int(np.sum((before != UNMATCHED) & (before != frame.tracks)))
        last[frame.vehicles] = frame.tracks
    return switches


def _fragmentations(comparison: Comparison, matched: Sequence[MatchedFrame]) -> int:
    before = np.zeros(len(comparison.vehicle_ids), np.bool_)
    starts = np.zeros(len(comparison.vehicle_ids), np.int64)
    for frame in matched:
        if not frame.frame.iou.size:
            continue
        now = np.zeros_like(before)
        now[frame.vehicles] = True
        starts += now & ~before
        before = now
    return int(np.maximum(starts - 1, 0).sum())


def false_tracks(comparison: Comparison, matched: Sequence[MatchedFrame]) -> int:
    """Return the number of tracks with more than half of their boxes unmatched.

    Boxes dropped for an ignore region do not count, so a track without other boxes is not false.
    """
    right = counts((frame.tracks for frame in matched), len(comparison.track_ids))
    return int(np.sum(2 * right < comparison.track_lengths()))


@dataclass(frozen=True)
class IdentityMetrics:
    """F1, precision and recall of boxes if every vehicle has at most one track, 0 to 1."""

    idf1: float
    idp: float
    idr: float


def identity_metrics(comparison: Comparison) -> IdentityMetrics:
    """Pair whole vehicles with whole tracks so that most boxes agree at IoU 0.5; score that."""
    agreements = np.zeros((len(comparison.vehicle_ids), len(comparison.track_ids)))
    for frame in comparison.frames:
        rows, columns = np.nonzero(frame.iou >= MATCH_IOU)
        agreements[frame.vehicles[rows], frame.tracks[columns]] += 1
    right = agreements[assign(agreements)].sum()
    vehicles = comparison.vehicle_lengths().sum()
    tracks = comparison.track_lengths().sum()
    return IdentityMetrics(
        idf1=ratio(2 * right, vehicles + tracks),
        idp=ratio(right, tracks),
        idr=ratio(right, vehicles),
    )


@dataclass(frozen=True)
class HotaMetrics:
    """HOTA and its two factors, detection accuracy and association accuracy, 0 to 1."""

    hota: float
    deta: float
    assa: float


def hota_metrics(comparison: Comparison) -> HotaMetrics:
    """Return HOTA, DetA and AssA, each the mean over `ALPHAS`."""
    if not len(comparison.vehicle_ids) or not len(comparison.track_ids):
        return HotaMetrics(0.0, 0.0, 0.0)
    lengths = comparison.vehicle_lengths()[:, np.newaxis], comparison.track_lengths()[np.newaxis, :]
    vehicles, tracks, iou = _hota_pairs(comparison, lengths)
    accuracies = np.array(
        [
            _hota_accuracies(lengths, vehicles[chosen], tracks[chosen])
            for chosen in (at_least(iou, alpha) for alpha in ALPHAS)
        ]
    )
    deta, assa = accuracies.mean(axis=0)
    return HotaMetrics(float(np.sqrt(accuracies.prod(axis=1)).mean()), float(deta), float(assa))


_Lengths = tuple[Int64Array, Int64Array]
"""Numbers of boxes: a column of vehicles and a row of tracks."""


def _hota_accuracies(lengths: _Lengths, vehicles: Int64Array, tracks: Int64Array) -> list[float]:
    """Return detection and association accuracy of the pairs that count."""
    of_vehicles, of_tracks = lengths
    together = np.zeros((of_vehicles.size, of_tracks.size))
    np.add.at(together, (vehicles, tracks), 1)
    matches = len(vehicles)
    deta = matches / (of_vehicles.sum() + of_tracks.sum() - matches)
    agreement = together / (of_vehicles + of_tracks - together)
    return [float(deta), ratio(float(np.sum(together * agreement)), matches)]


def _hota_pairs(
    comparison: Comparison, lengths: _Lengths
) -> tuple[Int64Array, Int64Array, Float64Array]:
    """Pair boxes in every frame by overlap and alignment: vehicles, tracks and their IoU."""
    alignment = _alignment(comparison, lengths)
    vehicles, tracks, iou = [], [], []
    for frame in comparison.frames:
        aligned = alignment[np.ix_(frame.vehicles, frame.tracks)]
        rows, columns = assign(aligned * frame.iou)
        vehicles.append(frame.vehicles[rows])
        tracks.append(frame.tracks[columns])
        iou.append(frame.iou[rows, columns])
    return joined(vehicles), joined(tracks), np.concatenate(iou)


def _alignment(comparison: Comparison, lengths: _Lengths) -> Float64Array:
    """Return how well vehicle and track agree over the whole video, `(vehicles, tracks)`."""
    of_vehicles, of_tracks = lengths
    shared = np.zeros((of_vehicles.size, of_tracks.size))
    for frame in comparison.frames:
        others = frame.iou.sum(axis=0)[np.newaxis, :] + frame.iou.sum(axis=1)[:, np.newaxis]
        total = others - frame.iou
        share = np.divide(frame.iou, total, out=np.zeros_like(total), where=total > 0)
        shared[np.ix_(frame.vehicles, frame.tracks)] += share
    return shared / (of_vehicles + of_tracks - shared)

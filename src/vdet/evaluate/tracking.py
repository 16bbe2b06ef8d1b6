"""Metrics of tracks: delays, id switches, fragmentations, identities, and HOTA.

Sources: Bernardin and Stiefelhagen, "Evaluating Multiple Object Tracking Performance: The CLEAR MOT
Metrics", 2008; Ristani et al., "Performance Measures and a Data Set for Multi-Target, Multi-Camera
Tracking", 2016; Luiten et al., "HOTA: A Higher Order Metric for Evaluating Multi-Object Tracking",
2020.
"""

import numpy as np

from vdet.boxes import Float64Array, Int64Array
from vdet.evaluate.comparison import MATCH_IOU, UNMATCHED, Comparison, at_least
from vdet.track.motion.pairing import assign

ALPHAS = np.arange(0.05, 0.99, 0.05)
"""The overlap thresholds of HOTA, 0.05 … 0.95; the metrics are the mean over them."""


def delays(comparison: Comparison) -> tuple[int | None, ...]:
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


def hota(comparison: Comparison) -> tuple[float, float, float]:
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

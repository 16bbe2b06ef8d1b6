"""Higher order tracking accuracy: detection and association weighed alike.

Source: Luiten et al., "HOTA: A Higher Order Metric for Evaluating Multi-Object Tracking",
IJCV 2021; details as in TrackEval.
"""

from dataclasses import dataclass

import numpy as np

from vdet.evaluate.assignment import assign, at_least
from vdet.evaluate.comparison import Comparison, joined
from vdet.evaluate.labelled_video import Integers
from vdet.evaluate.ratio import ratio
from vdet.geometry import Float64Array

ALPHAS = np.arange(0.05, 0.99, 0.05)
"""The overlaps from which a pair counts, 0.05 … 0.95; the metrics are the mean over them."""


@dataclass(frozen=True, slots=True)
class Hota:
    """HOTA with its two halves, detection and association accuracy, 0 to 1."""

    hota: float
    deta: float
    assa: float


def hota(comparison: Comparison) -> Hota:
    """Return HOTA, DetA and AssA, each the mean over `ALPHAS`."""
    if not len(comparison.vehicle_ids) or not len(comparison.track_ids):
        return Hota(0.0, 0.0, 0.0)
    vehicles, tracks, iou = _pairs(comparison)
    lengths = _lengths(comparison)
    parts = np.array(
        [
            _accuracies(lengths, vehicles[chosen], tracks[chosen])
            for chosen in (at_least(iou, alpha) for alpha in ALPHAS)
        ]
    )
    deta, assa = parts.mean(axis=0)
    return Hota(float(np.sqrt(parts.prod(axis=1)).mean()), float(deta), float(assa))


_Lengths = tuple[Integers, Integers]


def _lengths(comparison: Comparison) -> _Lengths:
    """Return the numbers of boxes as a column of vehicles and a row of tracks."""
    vehicles, tracks = comparison.vehicle_lengths(), comparison.track_lengths()
    return vehicles[:, np.newaxis], tracks[np.newaxis, :]


def _accuracies(lengths: _Lengths, vehicles: Integers, tracks: Integers) -> tuple[float, float]:
    """Return detection and association accuracy, given the pairs that count."""
    of_vehicles, of_tracks = lengths
    together = np.zeros((of_vehicles.size, of_tracks.size))
    np.add.at(together, (vehicles, tracks), 1)
    matches = len(vehicles)
    deta = matches / (of_vehicles.sum() + of_tracks.sum() - matches)
    agreement = together / (of_vehicles + of_tracks - together)
    return float(deta), ratio(float(np.sum(together * agreement)), matches)


def _pairs(comparison: Comparison) -> tuple[Integers, Integers, Float64Array]:
    """Pair boxes in every frame so that like follows like: vehicles, tracks and their IoU."""
    alignment = _alignment(comparison)
    vehicles, tracks, iou = [], [], []
    for frame in comparison.frames:
        likeness = alignment[np.ix_(frame.vehicles, frame.tracks)]
        rows, columns = assign(likeness * frame.iou)
        vehicles.append(frame.vehicles[rows])
        tracks.append(frame.tracks[columns])
        iou.append(frame.iou[rows, columns])
    return joined(vehicles), joined(tracks), np.concatenate(iou)


def _alignment(comparison: Comparison) -> Float64Array:
    """Return how far vehicle and track coincide over the whole video, `(vehicles, tracks)`."""
    of_vehicles, of_tracks = _lengths(comparison)
    shared = np.zeros((of_vehicles.size, of_tracks.size))
    for frame in comparison.frames:
        others = frame.iou.sum(axis=0)[np.newaxis, :] + frame.iou.sum(axis=1)[:, np.newaxis]
        total = others - frame.iou
        share = np.divide(frame.iou, total, out=np.zeros_like(total), where=total > 0)
        shared[np.ix_(frame.vehicles, frame.tracks)] += share
    return shared / (of_vehicles + of_tracks - shared)

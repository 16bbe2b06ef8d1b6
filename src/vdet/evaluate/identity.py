"""Identity metrics: how much of each vehicle one track tells.

Source: Ristani et al., "Performance Measures and a Data Set for Multi-Target, Multi-Camera
Tracking", 2016.
"""

from dataclasses import dataclass

import numpy as np

from vdet.evaluate.assignment import assign
from vdet.evaluate.comparison import Comparison
from vdet.evaluate.preprocessing import MATCH_IOU
from vdet.evaluate.ratio import ratio


@dataclass(frozen=True, slots=True)
class Identity:
    """F1, precision and recall of boxes once every vehicle has one track at most, 0 to 1."""

    idf1: float
    idp: float
    idr: float


def identity(comparison: Comparison) -> Identity:
    """Pair whole vehicles with whole tracks so that most boxes agree (IoU 0.5), and score that."""
    agreements = np.zeros((len(comparison.vehicle_ids), len(comparison.track_ids)))
    for frame in comparison.frames:
        rows, columns = np.nonzero(frame.iou >= MATCH_IOU)
        agreements[frame.vehicles[rows], frame.tracks[columns]] += 1
    right = agreements[assign(agreements)].sum()
    vehicles = comparison.vehicle_lengths().sum()
    tracks = comparison.track_lengths().sum()
    return Identity(
        idf1=ratio(2 * right, vehicles + tracks),
        idp=ratio(right, tracks),
        idr=ratio(right, vehicles),
    )

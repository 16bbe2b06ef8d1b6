"""How well vehicles are found, whatever their ids."""

from collections.abc import Sequence
from dataclasses import dataclass

from vdet.evaluate.average_precision import average_precisions
from vdet.evaluate.comparison import Comparison
from vdet.evaluate.matching import MatchedFrame
from vdet.evaluate.ratio import ratio


@dataclass(frozen=True, slots=True)
class Detection:
    """Counts of boxes over all frames and their ratios, 0 to 1.

    `matches` are boxes found at IoU 0.5, `false_positives` predictions that found nothing,
    `misses` vehicles' boxes not found. `mean_iou` is over the matches.
    """

    matches: int
    false_positives: int
    misses: int
    precision: float
    recall: float
    f1: float
    ap50: float
    ap50_95: float
    mean_iou: float


def detection(comparison: Comparison, matched: Sequence[MatchedFrame]) -> Detection:
    """Return the detection metrics; `matched` is `match(comparison)`."""
    matches = sum(len(frame) for frame in matched)
    vehicles = int(comparison.vehicle_lengths().sum())
    predictions = int(comparison.track_lengths().sum())
    precisions = average_precisions(comparison)
    return Detection(
        matches=matches,
        false_positives=predictions - matches,
        misses=vehicles - matches,
        precision=ratio(matches, predictions),
        recall=ratio(matches, vehicles),
        f1=ratio(2 * matches, predictions + vehicles),
        ap50=float(precisions[0]),
        ap50_95=float(precisions.mean()),
        mean_iou=ratio(sum(float(frame.iou.sum()) for frame in matched), matches),
    )

"""All metrics of a video under plain names."""

from dataclasses import asdict, dataclass

from vdet.evaluate.comparison import Comparison, compare, match
from vdet.evaluate.detection_metrics import DetectionMetrics, detection_metrics
from vdet.evaluate.timelines import FirstDetection, first_detections, vehicle_timelines
from vdet.evaluate.tracking_metrics import (
    ClearMetrics,
    HotaMetrics,
    IdentityMetrics,
    clear_metrics,
    false_tracks,
    hota_metrics,
    identity_metrics,
)
from vdet.labels.video import LabelledVideo


@dataclass(frozen=True, kw_only=True)
class Scores(DetectionMetrics, ClearMetrics, IdentityMetrics, HotaMetrics):
    """All metrics of a video.

    A ratio is 0 if there is nothing to divide by.

    Attributes
    ----------
    vehicles, vehicle_boxes, tracks, track_boxes
        What was counted, without ignore regions and the predictions dropped for them.
    first_detections
        One for every vehicle.
    mean_delay
        Mean frames until the first detection, over the vehicles that were found; None if none was.
    never_found
        Vehicles without any match.
    false_tracks
        Number of tracks with more than half of their boxes unmatched.
    false_tracks_per_minute
        None if the length of the video is not known.
    """

    vehicles: int
    vehicle_boxes: int
    tracks: int
    track_boxes: int
    first_detections: tuple[FirstDetection, ...]
    mean_delay: float | None
    never_found: int
    false_tracks: int
    false_tracks_per_minute: float | None


def score(prediction: LabelledVideo, truth: LabelledVideo, *, rate: float | None = None) -> Scores:
    """Score the predictions for a video against its truth.

    Parameters
    ----------
    rate
        Frames per second; None takes that of the predictions or the truth.
    """
    return score_comparison(compare(prediction, truth, rate=rate))


def score_comparison(comparison: Comparison) -> Scores:
    """Score a comparison: one video, or several that `pool` has joined."""
    matched = match(comparison)
    first = first_detections(vehicle_timelines(comparison, matched))
    delays = [each.delay for each in first if each.delay is not None]
    wrong = false_tracks(comparison, matched)
    minutes = comparison.seconds / 60 if comparison.seconds else None
    return Scores(
        vehicles=len(comparison.vehicle_ids),
        vehicle_boxes=int(comparison.vehicle_lengths().sum()),
        tracks=len(comparison.track_ids),
        track_boxes=int(comparison.track_lengths().sum()),
        first_detections=first,
        mean_delay=sum(delays) / len(delays) if delays else None,
        never_found=len(first) - len(delays),
        false_tracks=wrong,
        false_tracks_per_minute=wrong / minutes if minutes else None,
        **asdict(detection_metrics(comparison, matched)),
        **asdict(clear_metrics(comparison, matched)),
        **asdict(identity_metrics(comparison)),
        **asdict(hota_metrics(comparison)),
    )

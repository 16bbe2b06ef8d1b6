"""All metrics of a video under plain names."""

from dataclasses import asdict, dataclass

import numpy as np

from vdet.evaluate.average_precision import rank_predictions
from vdet.evaluate.comparison import Comparison, compare, counts
from vdet.evaluate.timelines import FirstDetection, first_detections, frames_too_long
from vdet.evaluate.tracking_metrics import fragmentations, hota, id_switches, identity_matches
from vdet.labels.video import LabelledVideo

_MOSTLY_TRACKED = 0.8
_MOSTLY_LOST = 0.2


@dataclass(frozen=True, kw_only=True)
class DetectionScores:
    """Counts of boxes over all frames and their ratios, 0 to 1; 0 if there is nothing to divide by.

    `matches` are true boxes found at IoU 0.5, `false_positives` predictions that found nothing,
    `misses` true boxes that were not found. `mean_iou` is the mean over the matches.
    """

    matches: int
    false_positives: int
    misses: int
    precision: float
    recall: float
    f1: float
    mean_iou: float


@dataclass(frozen=True, kw_only=True)
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
    motp
        Mean IoU of the matches, as `mean_iou`.
    id_switches
        Matches of a vehicle by another track than its last match, at any distance in time.
    fragmentations
        How often a vehicle is found again after it was missed or absent.
    mostly_tracked, partly_tracked, mostly_lost
        Vehicles found in more than 80 %, in 20 to 80 %, in less than 20 % of their boxes.
    idf1, idp, idr
        F1, precision and recall of boxes if every vehicle has at most one track, 0 to 1.
    hota, deta, assa
        HOTA and its two factors, detection accuracy and association accuracy, 0 to 1.
    vehicles, vehicle_boxes, tracks, track_boxes
        What was counted, without ignore regions and the predictions dropped for them.
    first_detections
        One for every vehicle.
    mean_delay
        Mean frames until the first detection, over the vehicles that were found; None if none was.
    mean_excess
        Mean frames for which a vehicle is shown after its last true box, over those that were
        found; None if none was.
    never_found
        Vehicles without any match.
    false_tracks
        Number of tracks with more than half of their boxes unmatched. Boxes dropped for an ignore
        region do not count, so a track without other boxes is not false.
    false_tracks_per_minute
        None if the length of the video is not known.
    """

    ap50: float
    ap50_95: float
    mota: float
    motp: float
    id_switches: int
    fragmentations: int
    mostly_tracked: int
    partly_tracked: int
    mostly_lost: int
    idf1: float
    idp: float
    idr: float
    hota: float
    deta: float
    assa: float
    vehicles: int
    vehicle_boxes: int
    tracks: int
    track_boxes: int
    first_detections: tuple[FirstDetection, ...]
    mean_delay: float | None
    mean_excess: float | None
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


def score_detections(comparison: Comparison) -> DetectionScores:
    """Score a comparison without regard to ids and scores."""
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
    frames = comparison.frames
    detection = score_detections(comparison)
    of_vehicles, of_tracks = comparison.vehicle_lengths(), comparison.track_lengths()
    vehicle_boxes, track_boxes = int(of_vehicles.sum()), int(of_tracks.sum())
    found = counts((frame.found for frame in frames), len(of_vehicles)) / of_vehicles
    tracked, lost = int(np.sum(found > _MOSTLY_TRACKED)), int(np.sum(found < _MOSTLY_LOST))
    right = counts((frame.found_by for frame in frames), len(of_tracks))
    false_tracks = int(np.sum(2 * right < of_tracks))
    first = first_detections(comparison)
    delays = [each.delay for each in first if each.delay is not None]
    excess = frames_too_long(comparison)
    switches, agreeing = id_switches(comparison), identity_matches(comparison)
    ap50, ap50_95 = rank_predictions(comparison).average_precisions()
    total, deta, assa = hota(comparison)
    return Scores(
        **asdict(detection),
        ap50=ap50,
        ap50_95=ap50_95,
        mota=ratio(detection.matches - detection.false_positives - switches, vehicle_boxes),
        motp=detection.mean_iou,
        id_switches=switches,
        fragmentations=fragmentations(comparison),
        mostly_tracked=tracked,
        partly_tracked=len(found) - tracked - lost,
        mostly_lost=lost,
        idf1=ratio(2 * agreeing, vehicle_boxes + track_boxes),
        idp=ratio(agreeing, track_boxes),
        idr=ratio(agreeing, vehicle_boxes),
        hota=total,
        deta=deta,
        assa=assa,
        vehicles=len(of_vehicles),
        vehicle_boxes=vehicle_boxes,
        tracks=len(of_tracks),
        track_boxes=track_boxes,
        first_detections=first,
        mean_delay=sum(delays) / len(delays) if delays else None,
        mean_excess=sum(excess) / len(excess) if excess else None,
        never_found=len(first) - len(delays),
        false_tracks=false_tracks,
        false_tracks_per_minute=(
            60 * false_tracks / comparison.seconds if comparison.seconds else None
        ),
    )


def ratio(part: float, whole: float) -> float:
    """Return `part / whole`; 0 if `whole` is 0, as in TrackEval."""
    return float(part / whole) if whole else 0.0

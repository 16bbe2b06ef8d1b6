"""All metrics of a video under plain names."""

from dataclasses import asdict, dataclass

from vdet.evaluate.clear import clear
from vdet.evaluate.comparison import Comparison
from vdet.evaluate.detection import detection
from vdet.evaluate.hota import hota
from vdet.evaluate.identity import identity
from vdet.evaluate.labelled_video import LabelledVideo
from vdet.evaluate.matching import match
from vdet.evaluate.preprocessing import compare
from vdet.evaluate.timeliness import FirstDetection, false_tracks, first_detections


@dataclass(frozen=True, slots=True)
class Scores:
    """What the modules of the same names explain; every ratio with nothing to divide by is 0.

    Attributes
    ----------
    vehicles, vehicle_boxes, tracks, track_boxes
        What was counted, ignore regions and what they swallowed aside.
    first_detections
        One for every vehicle.
    mean_delay
        Mean frames to the first detection of the vehicles found at all; None where none is.
    never_found
        Vehicles without any match.
    false_tracks
        Tracks of which more than half of the boxes match nothing.
    false_tracks_per_minute
        None where the length of the video is not known.
    """

    vehicles: int
    vehicle_boxes: int
    tracks: int
    track_boxes: int
    matches: int
    false_positives: int
    misses: int
    precision: float
    recall: float
    f1: float
    ap50: float
    ap50_95: float
    mean_iou: float
    mota: float
    motp: float
    idf1: float
    idp: float
    idr: float
    hota: float
    deta: float
    assa: float
    id_switches: int
    fragmentations: int
    mostly_tracked: int
    partly_tracked: int
    mostly_lost: int
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
        Frames a second; where it is not given, that of the predictions or the truth.
    """
    return score_comparison(compare(prediction, truth, rate=rate))


def score_comparison(comparison: Comparison) -> Scores:
    """Score a comparison: one video, or several that `pool` has joined for their total."""
    matched = match(comparison)
    first = first_detections(comparison, matched)
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
        **asdict(detection(comparison, matched)),
        **asdict(clear(comparison, matched)),
        **asdict(identity(comparison)),
        **asdict(hota(comparison)),
    )

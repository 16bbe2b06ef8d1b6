"""Labels from what a teacher has found: what was followed for long is sure, a flicker is not.

Vehicles are followed forwards and backwards in time, so that one is known from its first frame to
its last. A detection that no track needs, and a place where a track expects a vehicle that was not
seen, is an ignore region: neither vehicle nor background.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vdet.config.schema import Settings
from vdet.detect.detections import Detections
from vdet.evaluate.labelled_video import LabelledVideo
from vdet.formats.rows import Row
from vdet.geometry import Box
from vdet.track.factory import make_tracker
from vdet.track.track import Track

_SAME = 0.6  # least intersection over union of a detection and its track
_FIRST_REGION = 100_000
"""Ids of ignore regions begin here."""


@dataclass(frozen=True, slots=True)
class WatchedFrame:
    """What a teacher finds in frame `number`, from 1, shown at `time`, seconds.

    `change` is the mean difference from the frame before, grey levels.
    """

    number: int
    time: float
    detections: Detections
    change: float = 0.0


def label(
    frames: Sequence[WatchedFrame], settings: Settings, width: int, height: int
) -> LabelledVideo:
    """Return the vehicles and the ignore regions of consecutive frames.

    Parameters
    ----------
    settings
        Of the tracker, and `adapt`.
    """
    forwards = _follow(frames, settings, width, height)
    last = frames[-1].time if frames else 0.0
    turned = [WatchedFrame(f.number, last - f.time, f.detections) for f in reversed(frames)]
    backwards = list(reversed(_follow(turned, settings, width, height)))
    rows = [
        row
        for frame, one, other in zip(frames, forwards, backwards, strict=True)
        for row in _label_frame(frame, one, other, settings, width)
    ]
    return LabelledVideo.from_rows(rows, frame_count=frames[-1].number if frames else 0)


def _follow(
    frames: Sequence[WatchedFrame], settings: Settings, width: int, height: int
) -> list[list[Track]]:
    tracker = make_tracker(settings, width, height)
    return [tracker.update(frame.detections, frame.time) for frame in frames]


def _label_frame(
    frame: WatchedFrame,
    forwards: Sequence[Track],
    backwards: Sequence[Track],
    settings: Settings,
    width: int,
) -> list[Row]:
    seen = [track for track in (*forwards, *backwards) if not track.predicted]
    expected = [track.box for track in (*forwards, *backwards) if track.predicted]
    vehicles: list[Box] = []
    regions: list[Box] = []
    detections = frame.detections
    for box, score in zip(detections.rounded, detections.scores.tolist(), strict=True):
        followed = any(track.box.iou(box) >= _SAME for track in seen)
        is_wide = box.width >= settings.adapt.least_width * width
        if followed and is_wide:
            vehicles.append(box)
        elif followed or score >= settings.adapt.doubtful:
            regions.append(box)
    regions += [box for box in expected if all(box.iou(each) < _SAME for each in vehicles)]
    numbered = [(number, box, False) for number, box in enumerate(vehicles, start=1)]
    numbered += [(_FIRST_REGION + number, box, True) for number, box in enumerate(regions)]
    return [
        Row(0, frame.number, number, *(box.x, box.y, box.width, box.height), ignored=ignored)
        for number, box, ignored in numbered
        if box.area
    ]


def write_labels(labels: LabelledVideo, path: Path) -> None:
    """Write labels as truth in MOTChallenge form; see `vdet.formats.mot`."""
    with path.open("w", encoding="utf-8") as file:
        for frame, number, box, ignored in zip(
            labels.frames.tolist(),
            labels.ids.tolist(),
            labels.boxes.tolist(),
            labels.ignored.tolist(),
            strict=True,
        ):
            x, y, width, height = box
            place = f"{x + 1:g},{y + 1:g},{width:g},{height:g}"
            file.write(f"{frame},{number},{place},{int(not ignored)},1,1\n")

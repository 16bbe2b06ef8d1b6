"""The mistakes: missed vehicles and false alarms, and pictures of the worst with all boxes."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import cv2
import numpy as np

from vdet.boxes import Box, Float64Array, Image
from vdet.config.schema import InputSettings
from vdet.draw.paint import Color
from vdet.errors import counted
from vdet.evaluate.comparison import ComparedFrame, Comparison
from vdet.evaluate.images import MeasuredSet
from vdet.evaluate.scores import score_boxes
from vdet.media.reader import VideoReader

TRUE: Color = (90, 220, 60)
FOUND: Color = (40, 120, 255)

_MOST_PICTURES, _MOST_CROPS = 9, 24  # of each source; of each video
_SCALE = 3.0  # width of the part around a box, in sizes of the box

_Seen = tuple[int, Float64Array, float]
"""A frame with a mistake, the box, and its best IoU with any box of the other side."""


@dataclass(frozen=True, slots=True)
class Mistake:
    """Consecutive frames in which a vehicle is missed, or a track is a false alarm.

    Attributes
    ----------
    what
        `missed vehicle` or `false alarm, track`.
    id
        Of the vehicle in the truth, or of the track.
    first, middle, last
        Numbers of frames, from 1.
    boxes
        Number of boxes.
    box
        x1, y1, x2, y2 in the middle frame, pixels.
    overlap
        Mean over the frames of the best IoU with any box of the other side. Near 0: there is no
        such box. Below 0.5: the box fits badly. Above: the box is matched with another one.
    """

    what: str
    id: int
    first: int
    middle: int
    last: int
    boxes: int
    box: tuple[float, ...]
    overlap: float

    @property
    def name(self) -> str:
        """What the mistake is, as text."""
        return f"{self.what} {self.id}"

    @property
    def span(self) -> str:
        """The first and the last frame, as text."""
        return f"{self.first}–{self.last}" if self.boxes > 1 else str(self.first)


def mistakes(comparison: Comparison) -> tuple[Mistake, ...]:
    """Return all mistakes, the longest first.

    Frames in which a vehicle or a track does not count are not mistakes, and split one.
    """
    seen: dict[tuple[str, int], list[_Seen]] = defaultdict(list)
    for frame in comparison.frames:
        vehicles, tracks = (
            comparison.vehicle_ids[frame.vehicles],
            comparison.track_ids[frame.tracks],
        )
        for what, ids, boxes, iou, paired in (
            ("missed vehicle", vehicles, frame.vehicle_boxes, frame.iou, frame.rows),
            ("false alarm, track", tracks, frame.track_boxes, frame.iou.T, frame.columns),
        ):
            for row in np.setdiff1d(np.arange(len(ids)), paired).tolist():
                overlap = float(iou[row].max(initial=0))
                seen[what, int(ids[row])].append((frame.number, boxes[row], overlap))
    found = []
    for (what, id_), frames in seen.items():
        # Numbers of frames that follow one another are at one distance from their places.
        runs = groupby(enumerate(frames), lambda placed: placed[1][0] - comparison.step * placed[0])
        found += [_mistake(what, id_, [item for _, item in run]) for _, run in runs]
    return tuple(sorted(found, key=lambda one: (-one.boxes, one.first, one.what, one.id)))


def _mistake(what: str, id_: int, frames: Sequence[_Seen]) -> Mistake:
    (first, *_), (last, *_) = frames[0], frames[-1]
    middle, box, _ = frames[(len(frames) - 1) // 2]
    overlap = sum(frame[2] for frame in frames) / len(frames)
    return Mistake(what, id_, first, middle, last, len(frames), tuple(box.tolist()), overlap)


@dataclass(frozen=True, slots=True)
class Tile:
    """A BGR uint8 image with a title and a caption below it."""

    image: Image
    title: str
    caption: str


def worst_tiles(source: MeasuredSet) -> Iterator[Tile]:
    """Yield the pictures with the most mistakes among what counts.

    Raises `ImageError` if a picture can no longer be read.
    """
    scored = [(score_boxes(image.shown), image) for image in source.images]
    scored.sort(key=lambda pair: -pair[0][1] - pair[0][2])
    for (_, alarms, misses, *_), image in scored[:_MOST_PICTURES]:
        if alarms or misses:
            (frame,), picture = image.shown.frames, image.picture
            caption = f"{misses} missed, {counted(alarms, 'false alarm')}"
            yield Tile(_with_boxes(picture.read(), frame), picture.path.name, caption)


def mistake_tiles(video: Path, comparison: Comparison) -> Iterator[Tile]:
    """Yield the middle frame of the largest mistakes, cut around the box.

    The video is decoded again. Raises `VideoError`.
    """
    frames = {frame.number: frame for frame in comparison.frames}
    for mistake, image in _middle_frames(video, mistakes(comparison)[:_MOST_CROPS]):
        box = Box(*mistake.box)
        x, y = box.center
        width = max(_SCALE * max(box.width, box.height), image.shape[1] / 8)
        part = Box.sized(x - width / 2, y - width / 3, width, width / 1.5)
        drawn = _with_boxes(image, frames[mistake.middle])
        tile = part.clipped(image.shape[1], image.shape[0]).cut(drawn)
        caption = f"{mistake.span}: best IoU {mistake.overlap:.2f}"
        yield Tile(tile, f"{mistake.name}, frame {mistake.middle}", caption)


def _middle_frames(video: Path, chosen: Sequence[Mistake]) -> list[tuple[Mistake, Image]]:
    wanted = {mistake.middle for mistake in chosen}
    tolerant = InputSettings(max_damaged=1)  # it was accepted when it was scored
    with VideoReader(video, frames=max(wanted, default=1), settings=tolerant) as reader:
        images = {frame.index + 1: frame.image for frame in reader if frame.index + 1 in wanted}
    return [(mistake, images[mistake.middle]) for mistake in chosen if mistake.middle in images]


def _with_boxes(image: Image, frame: ComparedFrame) -> Image:
    drawn, line = image.copy(), 1 + image.shape[1] // 700
    for boxes, color in ((frame.vehicle_boxes, TRUE), (frame.track_boxes, FOUND)):
        for x1, y1, x2, y2 in boxes.round().astype(int).tolist():
            cv2.rectangle(drawn, (x1, y1), (x2, y2), color, line)
    return drawn

"""What the largest losses look like: the middle frame of each, cut out around the box."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from vdet.config.schema import InputSettings
from vdet.draw.boxes import Color
from vdet.evaluate.clips.evaluate import ClipResult
from vdet.evaluate.clips.losses import Kind, Loss
from vdet.evaluate.clips.text import frame_span, loss_name
from vdet.evaluate.comparison import ComparedFrame
from vdet.evaluate.report.page import Picture
from vdet.geometry import Float64Array
from vdet.media import VideoReader
from vdet.media.images import Image

TILE = (330, 220)
"""Width and height of a picture, pixels."""

TRUE_COLOR: Color = (90, 220, 60)
FOUND_COLOR: Color = (40, 120, 255)

_MOST = 12  # pictures of each kind
_ROOM = 2.4  # the cut-out is so many times as large as the box


@dataclass(frozen=True, slots=True)
class _View:
    """A part of the frame, `x, y` its top-left pixel, shown `scale` times as large."""

    x: float
    y: float
    scale: float


def loss_pictures(clip: ClipResult, kind: Kind) -> list[Picture]:
    """Return the largest losses of a kind, true boxes in green, found ones in orange.

    The video is decoded anew. Raises `VideoError`; the list is empty where there is no video.
    """
    chosen = [loss for loss in clip.losses if loss.kind == kind][:_MOST]
    if clip.video is None or not chosen:
        return []
    images = dict(_frames(clip.video, {loss.middle for loss in chosen}))
    compared = {frame.number: frame for frame in clip.comparison.frames}
    return [
        Picture(
            _cut_out(images[loss.middle], compared[loss.middle], _box_of(loss, clip)),
            f"{loss_name(loss)}, frame {loss.middle}",
            f"lost in {frame_span(loss)}, best IoU {loss.overlap:.2f}",
        )
        for loss in chosen
        if loss.middle in images
    ]


def _frames(video: Path, numbers: set[int]) -> Iterator[tuple[int, Image]]:
    tolerant = InputSettings(max_damaged=1)  # whoever scored the video has judged it already
    with VideoReader(video, frames=max(numbers), settings=tolerant) as reader:
        for frame in reader:
            if frame.index + 1 in numbers:
                yield frame.index + 1, frame.image


def _box_of(loss: Loss, clip: ClipResult) -> Float64Array:
    (frame,) = (each for each in clip.comparison.frames if each.number == loss.middle)
    if loss.kind == "missed":
        boxes = frame.vehicle_boxes[clip.comparison.vehicle_ids[frame.vehicles] == loss.id]
    else:
        boxes = frame.track_boxes[clip.comparison.track_ids[frame.tracks] == loss.id]
    box: Float64Array = boxes[0]
    return box


def _cut_out(image: Image, frame: ComparedFrame, box: Float64Array) -> Image:
    view = _view(image, box)
    placed = np.array(
        [[view.scale, 0, -view.x * view.scale], [0, view.scale, -view.y * view.scale]]
    )
    tile = np.asarray(cv2.warpAffine(image, placed, TILE, flags=cv2.INTER_LINEAR), np.uint8)
    _outline(tile, view, frame.vehicle_boxes, TRUE_COLOR, 3)
    _outline(tile, view, frame.track_boxes, FOUND_COLOR, 2)
    return tile


def _view(image: Image, box: Float64Array) -> _View:
    """Choose a part of the frame in the shape of a tile, around the box, inside the frame."""
    x, y, width, height = box.tolist()
    frame_height, frame_width = image.shape[:2]
    part = max(_ROOM * width, _ROOM * height * TILE[0] / TILE[1], frame_width / 8)
    part = min(part, frame_width, frame_height * TILE[0] / TILE[1])
    part_height = part * TILE[1] / TILE[0]
    left = min(max(0.0, x + width / 2 - part / 2), frame_width - part)
    top = min(max(0.0, y + height / 2 - part_height / 2), frame_height - part_height)
    return _View(left, top, TILE[0] / part)


def _outline(
    tile: Image, view: _View, boxes: Iterable[Float64Array], color: Color, line: int
) -> None:
    for x, y, width, height in boxes:
        near = round((x - view.x) * view.scale), round((y - view.y) * view.scale)
        far = round((x + width - view.x) * view.scale), round((y + height - view.y) * view.scale)
        cv2.rectangle(tile, near, far, color, line, cv2.LINE_AA)

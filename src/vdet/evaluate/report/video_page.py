"""The report on detection and tracking in videos."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from vdet.boxes import Float64Array
from vdet.config.schema import InputSettings
from vdet.draw.paint import Color
from vdet.evaluate.clips.evaluate import ClipResult, RunResult, best
from vdet.evaluate.clips.losses import Loss, LossKind
from vdet.evaluate.clips.text import (
    HEADINGS,
    LARGEST,
    clip_rows,
    detail_lines,
    frame_span,
    frames_line,
    loss_name,
    loss_row,
    setting_name,
    sweep_rows,
)
from vdet.evaluate.comparison import ComparedFrame
from vdet.evaluate.output import share
from vdet.evaluate.report.page import charts
from vdet.evaluate.report.video_charts import sweep_chart, tightness_chart, timeline_chart
from vdet.evaluate.scores import Scores
from vdet.media import VideoReader
from vdet.media.images import Image
from vdet.pages.frame import Picture, cards, contact_sheet, html_table, page, paragraph, section

TILE = (330, 220)
"""Width and height of a picture, pixels."""

TRUE_COLOR: Color = (90, 220, 60)
FOUND_COLOR: Color = (40, 120, 255)

_MOST_PICTURES = 12  # of each kind of loss
_CROP_SCALE = 2.4  # size of the crop, in sizes of the box


def video_page(runs: Sequence[RunResult], what: str) -> str:
    """Return the report as HTML; of a sweep, only the best setting is shown in full.

    `what` says what was measured. Needs matplotlib. Raises `VideoError` if a video can no longer be
    read for its pictures.
    """
    top = best(runs)
    subtitle = _subtitle(top, len(runs), what)
    return page("vdet: vehicles in video", subtitle, _sections(runs, top))


def _subtitle(top: RunResult, settings: int, what: str) -> str:
    best_of = f"; best of {settings} settings: {setting_name(top)}" if settings > 1 else ""
    return f"{', '.join(clip.name for clip in top.clips)}; {what}{best_of}"


def _sections(runs: Sequence[RunResult], top: RunResult) -> Iterator[str]:
    details = map(paragraph, [*map(frames_line, top.clips), *detail_lines(top.total)])
    rows = html_table(("video", *HEADINGS), clip_rows(top))
    yield section("In short", cards(_key_figures(top.total)), rows, *details)
    if len(runs) > 1:
        chart = charts([("precision and recall of each setting", sweep_chart(runs))])
        compared = html_table(("setting", *HEADINGS), sweep_rows(runs), best=runs.index(top))
        yield section("Settings compared", chart, compared)
    for clip in top.clips:
        yield section(
            f"Vehicle by vehicle: {clip.name}",
            charts([("timeline of each vehicle", timeline_chart(clip))]),
            *_first_detections(clip.scores),
        )
        yield from _losses(clip)
    yield section(
        "Boxes",
        charts([("average precision by IoU", tightness_chart(top))]),
        paragraph(
            "Average precision ranks the boxes by their score. Without scores it describes a "
            "single operating point."
        ),
    )


def _key_figures(scores: Scores) -> list[tuple[str, str]]:
    return [
        ("precision", share(scores.precision)),
        ("recall", share(scores.recall)),
        ("F1 at IoU 0.5", share(scores.f1)),
        ("MOTA", share(scores.mota)),
        ("IDF1", share(scores.idf1)),
        ("HOTA", share(scores.hota)),
        ("id switches", str(scores.id_switches)),
        ("false tracks", str(scores.false_tracks)),
    ]


def _first_detections(scores: Scores) -> Iterator[str]:
    rows = [
        [
            f"vehicle {first.vehicle}",
            str(first.appears),
            "never" if first.found is None else str(first.found),
            share(first.delay, 0),
        ]
        for first in scores.first_detections
    ]
    if rows:
        yield html_table(("", "appears in frame", "first found", "frames until then"), rows)


def _losses(clip: ClipResult) -> Iterator[str]:
    if not clip.losses:
        return
    headings = ("what", "frames", "boxes", "best IoU")
    yield section(
        f"Largest losses: {clip.name}",
        paragraph("Runs of frames with the same mistake, the longest first."),
        html_table(headings, [loss_row(loss) for loss in clip.losses[:LARGEST]]),
        *_sheet(clip, "missed", "Missed vehicles: true boxes in green, found ones in orange."),
        *_sheet(clip, "false alarm", "False alarms, in the same colours."),
    )


def _sheet(clip: ClipResult, kind: LossKind, legend: str) -> Iterator[str]:
    if pictures := loss_pictures(clip, kind):
        yield paragraph(legend)
        yield contact_sheet(pictures, TILE[0] * 2 // 3)


def loss_pictures(clip: ClipResult, kind: LossKind) -> list[Picture]:
    """Return the middle frame of the largest losses of a kind, cropped around the box.

    True boxes are green, found ones orange. The video is decoded again. The list is empty if there
    is no video. Raises `VideoError`.
    """
    chosen = [loss for loss in clip.losses if loss.kind == kind][:_MOST_PICTURES]
    if clip.video is None or not chosen:
        return []
    images = dict(_frames(clip.video, {loss.middle for loss in chosen}))
    compared = {frame.number: frame for frame in clip.comparison.frames}
    return [
        Picture(
            _cropped(images[loss.middle], compared[loss.middle], _box_of(loss, clip)),
            f"{loss_name(loss)}, frame {loss.middle}",
            f"lost in {frame_span(loss)}, best IoU {loss.overlap:.2f}",
        )
        for loss in chosen
        if loss.middle in images
    ]


def _frames(video: Path, numbers: set[int]) -> Iterator[tuple[int, Image]]:
    tolerant = InputSettings(max_damaged=1)  # it was accepted when it was scored
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


@dataclass(frozen=True, slots=True)
class _Crop:
    """A part of the frame, `x, y` its top-left pixel, enlarged `scale` times."""

    x: float
    y: float
    scale: float


def _cropped(image: Image, frame: ComparedFrame, box: Float64Array) -> Image:
    crop = _crop_around(image, box)
    placed = np.array(
        [[crop.scale, 0, -crop.x * crop.scale], [0, crop.scale, -crop.y * crop.scale]]
    )
    tile = np.asarray(cv2.warpAffine(image, placed, TILE, flags=cv2.INTER_LINEAR), np.uint8)
    _outline(tile, crop, frame.vehicle_boxes, TRUE_COLOR, 3)
    _outline(tile, crop, frame.track_boxes, FOUND_COLOR, 2)
    return tile


def _crop_around(image: Image, box: Float64Array) -> _Crop:
    """Choose a part of the frame around the box, with the aspect ratio of a tile."""
    x, y, width, height = box.tolist()
    frame_height, frame_width = image.shape[:2]
    part = max(_CROP_SCALE * width, _CROP_SCALE * height * TILE[0] / TILE[1], frame_width / 8)
    part = min(part, frame_width, frame_height * TILE[0] / TILE[1])
    part_height = part * TILE[1] / TILE[0]
    left = min(max(0.0, x + width / 2 - part / 2), frame_width - part)
    top = min(max(0.0, y + height / 2 - part_height / 2), frame_height - part_height)
    return _Crop(left, top, TILE[0] / part)


def _outline(
    tile: Image, crop: _Crop, boxes: Iterable[Float64Array], color: Color, line: int
) -> None:
    for x, y, width, height in boxes:
        near = round((x - crop.x) * crop.scale), round((y - crop.y) * crop.scale)
        far = round((x + width - crop.x) * crop.scale), round((y + height - crop.y) * crop.scale)
        cv2.rectangle(tile, near, far, color, line, cv2.LINE_AA)

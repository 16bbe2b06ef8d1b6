"""The sinks `video` and `image`: frames with boxes, labels, trails and counts."""

import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from vdet.config.classes import STANDARD_CLASSES
from vdet.config.schema import Settings
from vdet.draw import (
    GREEN,
    WHITE,
    Color,
    Surface,
    color_of,
    draw_box,
    draw_labels,
    draw_lines,
    line_width,
)
from vdet.errors import OutputError
from vdet.media import Frame, Picture, Planes, VideoInfo
from vdet.media.images import IMAGE_SUFFIXES, encode_image
from vdet.media.writer import VIDEO_SUFFIXES, VideoWriter, may_replace_video
from vdet.polygons import Point
from vdet.run.sinks.protocol import SinkContext, Writing, sink
from vdet.run.steps import FrameResult
from vdet.track.track import Track
from vdet.workers import core_count, write_async

if TYPE_CHECKING:
    from vdet.traffic.counter import VehicleCounter

VIDEO_LABELS = ("id", "class"), ("id",)
IMAGE_LABELS = ("class", "score"), ("score",)
"""Parts of the label of a vehicle if it fits the box, and otherwise."""


class Overlay:
    """Draws the vehicles and the lane of one video, or of one image.

    Parameters
    ----------
    video
        None for a single image, which has no trails.
    counter
        Its current counts are drawn if `traffic.draw` is set.
    """

    def __init__(
        self, settings: Settings, video: VideoInfo | None, counter: "VehicleCounter | None" = None
    ) -> None:
        self._settings, self._draw = settings, settings.draw
        self._longest = self._draw.trails if video else None
        self._counter = counter if settings.traffic.draw else None
        automatic = VIDEO_LABELS if video else IMAGE_LABELS
        self._labels = automatic if self._draw.label is None else (self._draw.label,)
        self._trails: dict[int, list[tuple[float, Point]]] = {}  # with the time in seconds

    def draw(self, result: FrameResult, used: Planes | None = None) -> Surface:
        """Return a copy of the frame with its vehicles: BGR or planes, like the frame itself.

        The memory of `used` is reused.
        """
        surface = result.frame.picture.copy(used)
        if result.road and result.road.lane:
            from vdet.lanes.road import draw_lane

            draw_lane(surface, result.road.lane)
        shown = sorted(result.tracks, key=lambda track: track.box.y2)  # farthest first
        if self._counter:
            draw_running_counts(surface, self._counter)
        self._draw_trails(surface, shown, float(result.frame.time))
        self._draw_vehicles(surface, shown)
        return surface

    def _draw_trails(self, surface: Surface, shown: Sequence[Track], now: float) -> None:
        if not self._longest:
            return
        for track in shown:
            self._trails.setdefault(track.id, []).append((now, track.foot))
        since, trails = now - self._longest, self._trails.items()
        kept = {number: [item for item in points if item[0] >= since] for number, points in trails}
        self._trails = {number: points for number, points in kept.items() if points}
        for track in shown:
            path = [point for _, point in self._trails[track.id]]
            draw_lines(surface, path, self._color(track), line_width(surface))

    def _draw_vehicles(self, surface: Surface, shown: Sequence[Track]) -> None:
        colors = [self._color(track) for track in shown]
        for track, color in zip(shown, colors, strict=True):
            draw_box(surface, track.box, color, dashed=track.state == "predicted")
        texts = [[track.label(parts) for parts in self._labels] for track in shown]
        draw_labels(surface, [track.box for track in shown], texts, colors)

    def _color(self, track: Track) -> Color:
        if self._draw.colors == "one":
            return GREEN
        number = track.id if self._draw.colors == "id" else _class_number(track.class_name)
        return color_of(number) if number else WHITE


def _class_number(name: str | None) -> int:
    """Return a number for the colour of a class; 0 if the class is unknown."""
    if name in STANDARD_CLASSES:
        return STANDARD_CLASSES.index(name) + 1
    return zlib.crc32(name.encode()) if name else 0


def draw_running_counts(surface: Surface, counter: "VehicleCounter") -> None:
    """Draw the lines and zones with their current counts; vehicles are drawn over them."""
    from vdet.pages.traffic import border_marks, draw_marks

    counts = counter.so_far()
    marks = [mark for line in counter.lines for mark in border_marks(line, counts)]
    for zone in counter.zones:
        enter, leave, appear, vanish = (counts[zone.name, way] for way in zone.directions)
        marks += border_marks(zone, counts, f": {enter + appear - leave - vanish}")
    draw_marks(surface, marks)


@sink(
    suffixes=VIDEO_SUFFIXES,
    what="videos",
    takes="videos",
    uses_traffic=False,  # it draws counts only if the settings have lines or zones
    may_replace=may_replace_video,
)
def video(path: Path, context: SinkContext) -> Writing:
    """Draw on copies of the frames, and encode them in a thread."""
    video, traffic = context.of_video
    overlay = Overlay(context.settings, video, traffic.counter)
    used: list[Planes] = []  # allocating memory would take longer than copying into it
    writer = VideoWriter(
        context.files.stage(path),
        video,
        context.settings.output,
        name=path,
        whole_audio=not context.is_part,
        threads=core_count(),  # more or fewer would write other bytes
    )

    def encode(frame: Frame) -> None:
        writer.write(frame)
        if planes := frame.picture.planes:
            used.append(planes)

    with write_async(encode, within=writer) as put:
        while result := (yield):
            surface = overlay.draw(result, used.pop() if used else None)
            put(Frame(result.frame.index, result.frame.time, Picture(surface)))


@sink(suffixes=sorted(IMAGE_SUFFIXES), what="images", takes="images")
def image(path: Path, context: SinkContext) -> Writing:
    """Draw the vehicles on one image, and write it. Raises `OutputError` for a second one."""
    if result := (yield):
        drawn = Picture(Overlay(context.settings, None).draw(result))
        context.files.stage(path).write_bytes(encode_image(drawn.image, path))
        if (yield):
            raise OutputError(f"{path}: is for one image; for several, use a folder")

"""The sink `video`: the video with the vehicles and the lane drawn into it."""

from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

from vdet.draw.boxes import color_of, draw_box
from vdet.lanes.drawing import draw_lane
from vdet.media import Frame, VideoWriter
from vdet.media.images import Image
from vdet.media.writer import VIDEO_SUFFIXES, may_replace_video
from vdet.pipeline.result import FrameResult
from vdet.pipeline.sinks.counts import CountsPicture, layout_of
from vdet.pipeline.sinks.protocol import SinkContext, SinkKind
from vdet.pipeline.threads import write_async
from vdet.track.track import Track

FINISH_RATE = 5_000_000
"""Bytes a second. At its end an .mp4 is written once more, with its index in front."""


class VideoSink:
    """Draws into copies of the frames, and encodes them in a thread."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        assert context.video is not None  # `takes` says so
        self._path = path
        self._context = context
        self._video = context.video
        self._scores = context.settings.output.scores
        counts = context.settings.counts
        self._counts = CountsPicture(layout_of(context)) if counts and counts.drawn else None
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        context = self._context
        writer = VideoWriter(
            context.files.stage(self._path, may_replace_video),
            self._video,
            context.settings.output,
            name=self._path,
            whole_sound=not context.is_part,
            threads=context.codec_threads,
        )
        timeout = context.timeout

        def end_timeout() -> float | None:
            return None if timeout is None else timeout + writer.size / FINISH_RATE

        with ExitStack() as stack:
            self._encode = stack.enter_context(
                write_async(writer.write, within=writer, timeout=timeout, end_timeout=end_timeout)
            )
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *raised: Any) -> None:
        self._stack.__exit__(*raised)

    def write(self, result: FrameResult) -> None:
        """Draw the shown vehicles, and give the frame to the encoder."""
        image = annotate(result, scores=self._scores)
        if self._counts:
            image = self._counts.draw(image, result)
        self._encode(Frame(result.frame.index, result.frame.time, image))


VIDEO = SinkKind(VideoSink, VIDEO_SUFFIXES, "videos", takes="videos", may_replace=may_replace_video)


def annotate(result: FrameResult, *, scores: bool) -> Image:
    """Return a copy of the frame with its vehicles; the frame's own image if there are none.

    If lanes are searched for, it is a copy of the undistorted frame with the lane, and the boxes
    of the vehicles are undistorted too.
    """
    road, tracks = result.road, result.tracks
    if road is None:
        image = result.frame.image
        return draw_tracks(image.copy(), tracks, scores=scores) if tracks else image
    image = road.image.copy()
    if road.lane:
        draw_lane(image, road.lane)
    placed = (replace(track, box=road.place(track.box)) for track in tracks)
    return draw_tracks(image, (track for track in placed if track.box.area), scores=scores)


def draw_tracks(image: Image, tracks: Iterable[Track], *, scores: bool) -> Image:
    """Draw vehicles into an image, and return it.

    Each id has its own colour and is the label, with `scores` the score too. Predicted boxes are
    dashed.
    """
    for track in tracks:
        label = f"#{track.id} {track.score:.2f}" if scores else f"#{track.id}"
        draw_box(image, track.box, color_of(track.id), label, dashed=track.predicted)
    return image

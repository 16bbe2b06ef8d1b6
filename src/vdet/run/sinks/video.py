"""The sink `video`: the video with the vehicles and the lane drawn into it."""

from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

from vdet.media import Frame, Picture, VideoWriter
from vdet.media.writer import VIDEO_SUFFIXES, may_replace_video
from vdet.run.result import FrameResult
from vdet.run.sinks.counts import draw_running_counts
from vdet.run.sinks.overlay import Overlay
from vdet.run.sinks.protocol import SinkContext, SinkKind
from vdet.run.threads import write_async

FINISH_RATE = 5_000_000
"""Bytes a second. At its end an .mp4 is written once more, with its index in front."""


class VideoSink:
    """Draws into copies of the frames, and encodes them in a thread."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        assert context.video is not None  # `takes` says so
        self._path = path
        self._context = context
        self._video = context.video
        self._overlay = Overlay(context.settings, context.video)
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
        with self._context.waits.on("encoding"):
            self._stack.__exit__(*raised)

    def write(self, result: FrameResult) -> None:
        """Draw the shown vehicles, and give the frame to the encoder."""
        surface = self._overlay.draw(result)
        if result.counter and self._context.settings.counts.drawn:
            draw_running_counts(surface, result.counter, result.road)
        with self._context.waits.on("encoding"):
            self._encode(Frame(result.frame.index, result.frame.time, Picture(surface)))


VIDEO = SinkKind(VideoSink, VIDEO_SUFFIXES, "videos", takes="videos", may_replace=may_replace_video)

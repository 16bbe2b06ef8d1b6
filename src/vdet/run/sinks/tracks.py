"""The sink `tracks`: the shown boxes of each frame; the end of the name chooses the format.

The formats are those of `vdet.labels.formats`. The path `-` stands for standard output, as
`.jsonl`, frame by frame as they are done.

Boxes are in pixels of the input frame, even if the frame is drawn undistorted, so they can be
compared with labels of the input. In `.jsonl` a frame has `lane` if the lane is looked for: null if
none is shown, else an object with `radius` (metres, null on a straight road), `offset` (of the
camera from the middle of the lane, metres, positive to the right), `width` (metres), `left` and
`right`: each line as `[[x, y], …]`, pixels of the undistorted frame counted from 0, the nearest
point first.
"""

import sys
from pathlib import Path
from typing import BinaryIO, Self

from vdet.errors import OutputError
from vdet.labels.formats import Format, SourceVideo, TrackWriter, format_for, track_suffixes
from vdet.labels.json_lines import JSON_LINES
from vdet.run.result import FrameResult
from vdet.run.sinks.protocol import STANDARD_OUTPUT, SinkContext, SinkKind


class TrackSink:
    """Writes the shown tracks of each frame."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        self._path = path
        self._context = context
        self._file: BinaryIO | None = None
        self._writer: TrackWriter

    def __enter__(self) -> Self:
        if self._path == STANDARD_OUTPUT:
            self._writer = JSON_LINES.write(sys.stdout.buffer, None)
            return self
        form = _format_of(self._path, self._context)
        self._file = self._context.files.stage(self._path).open("wb")
        self._writer = form.write(self._file, _source_video(self._context))
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._file is None:
            sys.stdout.flush()
            return
        with self._file:
            if kind is None:
                self._writer.end()

    def write(self, result: FrameResult) -> None:
        """Add the tracks of a frame."""
        self._writer.write(result.frame_tracks)


def _format_of(path: Path, context: SinkContext) -> Format:
    form = format_for(path)
    assert form is not None  # the suffixes of the kind say so
    if form.needs_video and context.video is None:
        raise OutputError(f"{path}: {form.name} is for videos; give another format for pictures")
    return form


def _source_video(context: SinkContext) -> SourceVideo | None:
    video = context.video
    if video is None:
        return None
    frames = video.frames if context.is_part else None  # a whole video has those that are read
    return SourceVideo(video.path.name, video.width, video.height, frames)


TRACKS = SinkKind(TrackSink, track_suffixes, "tracks", writes_standard_output=True)

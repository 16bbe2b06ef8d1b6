"""The sink `picture`: a still picture with its vehicles, and its lane, drawn in."""

from pathlib import Path
from typing import Self

from vdet.media.images import PICTURE_SUFFIXES, encode_image
from vdet.pipeline.result import FrameResult
from vdet.pipeline.sinks.protocol import SinkContext, SinkKind
from vdet.pipeline.sinks.video import annotated


class PictureSink:
    """Writes each picture that comes to the same path: made for one."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        self._path = path
        self._context = context

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        pass

    def write(self, result: FrameResult) -> None:
        """Draw the vehicles with their scores, and write the picture."""
        data = encode_image(annotated(result, scores=True), self._path)
        self._context.files.stage(self._path).write_bytes(data)


PICTURE = SinkKind(PictureSink, sorted(PICTURE_SUFFIXES), "pictures")

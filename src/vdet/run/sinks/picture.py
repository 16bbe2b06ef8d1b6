"""The sink `picture`: a still picture with the vehicles and the lane drawn into it."""

from pathlib import Path
from typing import Self

from vdet.errors import OutputError
from vdet.media import Picture
from vdet.media.images import PICTURE_SUFFIXES, encode_image
from vdet.run.result import FrameResult
from vdet.run.sinks.overlay import Overlay
from vdet.run.sinks.protocol import SinkContext, SinkKind


class PictureSink:
    """Writes one picture."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        self._path = path
        self._context = context
        self._overlay = Overlay(context.settings, None)
        self._is_done = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        pass

    def write(self, result: FrameResult) -> None:
        """Draw the vehicles, and write the picture.

        Raises `OutputError` for a second picture.
        """
        if self._is_done:
            raise OutputError(
                f"{self._path}: takes one picture; for several give the name of a folder"
            )
        self._is_done = True
        data = encode_image(Picture(self._overlay.draw(result)).image, self._path)
        self._context.files.stage(self._path).write_bytes(data)


PICTURE = SinkKind(PictureSink, sorted(PICTURE_SUFFIXES), "pictures", takes="pictures")

"""Write a video that appears under its name only when complete."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol, Self

import av

from vdet.config.schema import OutputSettings
from vdet.errors import OutputError, VideoError
from vdet.media.encoder import Encoder
from vdet.media.frame import Frame, VideoInfo

VIDEO_SUFFIXES = (".mp4", ".mov", ".mkv")


class FrameWriter(Protocol):
    """Takes the frames of one video; a context manager."""

    def __enter__(self) -> Self: ...

    def __exit__(self, *raised: object) -> None: ...

    def write(self, frame: Frame) -> None:
        """Take the next frame; times must increase from one to the next."""


class NullWriter:
    """A `FrameWriter` that writes nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        pass

    def write(self, frame: Frame) -> None:
        """Forget `frame`."""


class VideoWriter:
    """A `FrameWriter` that writes H.264, yuv420p, with the sound of the source.

    Nothing appears at `path` before the end of the ``with`` block, and nothing at all if that is
    left by an exception. The first frame is shown at second 0, every other exactly as long after
    it as in the source (mkv: to the millisecond). Sides of odd length grow by one pixel, the last
    row or column repeated: 4:2:0 needs even ones. Colours are coded by BT.601, limited range, and
    tagged so where the source was tagged at all. Sound packets are copied, not encoded again.

    Parameters
    ----------
    path
        The file to write, .mp4, .mov or .mkv.
    info
        Of the source; frames must have its width and height.
    settings
        Codec, preset and quality.
    whole_sound
        True: the sound goes on to its own end. False: it ends with the last frame written, which
        is right where the frames are only a part of the source.
    threads
        Of the encoder; None lets it choose.

    Raises
    ------
    OutputError
        The suffix is another, or the file cannot be written (from every method).
    VideoError
        No frame was written (at the end), or the source of the sound cannot be opened.
    """

    def __init__(
        self,
        path: Path,
        info: VideoInfo,
        settings: OutputSettings,
        *,
        name: Path | None = None,
        whole_sound: bool = True,
        threads: int | None = None,
    ) -> None:
        if path.suffix.lower() not in VIDEO_SUFFIXES:
            names = ", ".join(VIDEO_SUFFIXES)
            raise OutputError(f"{path}: videos are written as {names}; name it so")
        self._file = path
        self._path = name or path
        self._info = info
        self._settings = settings
        self._whole_sound = whole_sound
        self._threads = threads
        self._encoder: Encoder | None = None

    def __enter__(self) -> Self:
        with contextlib.ExitStack() as stack:
            stack.push(self._refuse_none)
            stack.enter_context(self._naming_the_file())
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *raised: Any) -> None:
        self._stack.__exit__(*raised)

    def write(self, frame: Frame) -> None:
        """Encode the next frame; times must increase from one to the next."""
        with self._naming_the_file():
            if self._encoder is None:
                self._encoder = self._stack.enter_context(self._open(frame))
            self._encoder.write(frame)

    def _open(self, first: Frame) -> Encoder:
        return Encoder(
            self._file,
            self._info,
            self._settings,
            origin=first.time,
            whole_sound=self._whole_sound,
            threads=self._threads,
        )

    def _refuse_none(self, *raised: Any) -> None:
        if self._encoder is None and raised[0] is None:
            raise VideoError(f"{self._path}: there was no frame to write; check the times given")

    @contextlib.contextmanager
    def _naming_the_file(self) -> Iterator[None]:
        try:
            yield
        except av.FFmpegError as error:
            raise OutputError(f"{self._path}: cannot be written: {error.strerror}") from error

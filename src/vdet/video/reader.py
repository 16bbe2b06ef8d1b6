"""Read a video: upright BGR frames with their exact times."""

import itertools
import logging
import math
from collections.abc import Generator, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Self

import av
import numpy as np
from numpy.typing import NDArray

from vdet.errors import VideoError
from vdet.video.clock import Clock
from vdet.video.decoder import Decoder
from vdet.video.demux import open_input
from vdet.video.frame import Frame, VideoInfo
from vdet.video.pixels import fitted, to_bgr
from vdet.video.probe import describe, picture_stream, stated_duration

_log = logging.getLogger("vdet")
_SHORTFALL = Fraction(1, 100)  # of its declared duration that a whole file may lack


class VideoReader:
    """The frames of a video file, in order; a context manager, to be gone through once.

    Delivered are the frames with ``start <= time - info.start < end``, seconds counted from the
    file's first frame as a player does, and at most `frames` of them. What lies before `start` is
    decoded and dropped, for only so are the indices exact in every file.

    The first stream of moving pictures is read. Frames are turned upright; one of another size
    than the first is scaled to it. A time that is missing, or not later than the one before, is
    guessed from the rate. Damaged packets are skipped; at the end of the file one warning (logger
    "vdet") tells of them, and of an end that comes before the declared one.

    Parameters
    ----------
    path
        The file.
    start, end
        Seconds after the file's first frame; None for no limit.
    frames
        Most frames to deliver; None for no limit.
    threads
        Of the decoder; None lets it choose.

    Raises
    ------
    VideoError
        The file is missing, is not a video, or not one frame of it can be decoded.
    """

    def __init__(
        self,
        path: Path,
        *,
        start: Fraction | None = None,
        end: Fraction | None = None,
        frames: int | None = None,
        threads: int | None = None,
    ) -> None:
        self._start = start or Fraction(0)
        self._end = end
        self._limit = frames
        self._faults: list[str] = []
        self._container = open_input(path)
        try:
            self._stream = picture_stream(self._container, path)
            self._decoder = Decoder(self._container, self._stream, threads=threads)
            self._pictures = self._decoder.pictures()
            first = next(self._pictures, None)
            if first is None:
                raise VideoError(f"{path}: not one frame can be decoded; give a file that plays")
            self.info: VideoInfo = describe(path, self._container, self._stream, first)
        except BaseException:
            self._container.close()
            raise
        self._frames = self._deliver(first)

    @property
    def damaged(self) -> int:
        """Frames lost, or shown with errors, so far."""
        return self._decoder.damaged

    @property
    def expected(self) -> int | None:
        """About how many frames will be delivered; None where the file gives no idea."""
        if self.info.frames is None:
            return None
        last = self.info.frames
        if self._end is not None:
            last = min(last, math.ceil(self._end * self.info.rate))
        count = max(0, last - math.ceil(self._start * self.info.rate))
        return count if self._limit is None else min(count, self._limit)

    def __iter__(self) -> Iterator[Frame]:
        return self._frames

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the file; the reader gives no more frames."""
        self._frames.close()
        self._container.close()

    def _deliver(self, first: av.VideoFrame) -> Generator[Frame, None, None]:
        try:
            yield from itertools.islice(self._selected(first), self._limit)
            self._warn()
        finally:
            self._container.close()

    def _selected(self, first: av.VideoFrame) -> Iterator[Frame]:
        for index, time, picture in self._timed(first):
            since = time - self.info.start
            if self._end is not None and since >= self._end:
                return
            if since >= self._start:
                yield Frame(index, time, self._image(picture))

    def _image(self, picture: av.VideoFrame) -> NDArray[np.uint8]:
        info = self.info
        try:
            return fitted(to_bgr(picture, info.rotation), info.width, info.height)
        except (av.FFmpegError, ValueError) as error:
            coding = picture.format.name
            raise VideoError(
                f"{info.path}: its pixels ({coding}) cannot be converted; convert it to H.264 first"
            ) from error

    def _timed(self, first: av.VideoFrame) -> Iterator[tuple[int, Fraction, av.VideoFrame]]:
        period = 1 / self.info.rate
        clock = Clock(self.info.time_base, period)
        for index, picture in enumerate(itertools.chain([first], self._pictures)):
            time = clock.time(picture.pts)
            yield index, time, picture
        shown = max(period, picture.duration * self.info.time_base)
        self._compare(index + 1, time + shown - self.info.start)

    def _compare(self, frames: int, duration: Fraction) -> None:
        """Note it if what was read, to the end of the file, is less than the file declares."""
        stated = stated_duration(self._stream, self.info.start)
        tolerance = max(2 / self.info.rate, (stated or 0) * _SHORTFALL)
        if stated is not None and stated - duration > tolerance:
            self._faults.append(f"ends early: {frames} of {self.info.frames} frames could be read")

    def _warn(self) -> None:
        if self.damaged:
            self._faults.insert(0, f"{self.damaged} frames damaged or lost")
        if self._faults:
            _log.warning("%s: %s", self.info.path, "; ".join(self._faults))

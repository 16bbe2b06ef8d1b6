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

from vdet.config.schema import InputSettings
from vdet.errors import VideoError
from vdet.media.clock import Clock
from vdet.media.decoder import Decoder
from vdet.media.demux import MAX_PIXELS
from vdet.media.frame import Frame, VideoInfo
from vdet.media.pixels import fitted, to_bgr
from vdet.media.probe import check_size, describe, stated_duration

_log = logging.getLogger("vdet")
_USUAL = InputSettings()
_SHORTFALL = Fraction(1, 100)  # of its duration that a whole file may lack


class VideoReader:
    """The frames of a video file, in order; a context manager, to be gone through once.

    Delivered are the frames with ``start <= time - info.start < end``, seconds counted from the
    file's first frame as a player does, and at most `frames` of them. What lies before `start` is
    decoded and dropped, for only so are the indices exact in every file.

    The first stream of moving pictures is read. Frames are turned upright; one of another size
    than the first is scaled to it. A time that is missing, or not later than the one before, is
    guessed from the rate. Damaged packets are skipped. At the end one warning (logger "vdet") tells
    of frames lost, or shown with errors, of an end that comes before the declared one, of gaps in
    otherwise regular times, and of frames that were scaled.

    Parameters
    ----------
    path
        The file; or numbered pictures, as `img_%04d.png`, without a gap, from whichever number on.
    start, end
        Seconds after the file's first frame; None for no limit.
    frames
        Most frames to deliver; None for no limit.
    threads
        Of the decoder; None lets it choose. The frames are the same whatever their number; of a
        damaged file, nearly always.
    settings
        How much damage is tolerated, and the rate of numbered pictures.

    Raises
    ------
    VideoError
        The file is missing, is not a video, or not one frame of it can be decoded. After the last
        frame: more of those gone through were damaged or lost than is tolerated.
    """

    def __init__(
        self,
        path: Path,
        *,
        start: Fraction | None = None,
        end: Fraction | None = None,
        frames: int | None = None,
        threads: int | None = None,
        settings: InputSettings = _USUAL,
    ) -> None:
        self._start = start or Fraction(0)
        self._end = end
        self._limit = frames
        self._tolerated = settings.max_damaged
        self._faults: list[str] = []
        self._scaled: set[tuple[int, int]] = set()
        self._decoder = Decoder(path, threads=threads, frame_rate=settings.frame_rate)
        try:
            self._pictures = self._decoder.pictures()
            first = next(self._pictures, None)
            if first is None:
                raise VideoError(
                    f"{path}: not one frame can be decoded; give a file that plays, of at most "
                    f"{MAX_PIXELS // 10**6} million pixels a frame"
                )
            check_size(path, first.width, first.height)
            self.info: VideoInfo = describe(
                path, self._decoder.container, self._decoder.stream, first
            )
        except BaseException:
            self._decoder.close()
            raise
        self._frames = self._deliver(first)

    @property
    def damaged(self) -> int:
        """Frames lost, or shown with errors, so far."""
        return self._decoder.losses.damaged

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
        self._decoder.close()

    def _deliver(self, first: av.VideoFrame) -> Generator[Frame, None, None]:
        try:
            yield from itertools.islice(self._selected(first), self._limit)
            self._judge()
        finally:
            self._decoder.close()

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
            image = to_bgr(picture, info.rotation)
        except (av.FFmpegError, ValueError) as error:
            coding = picture.format.name
            raise VideoError(
                f"{info.path}: its pixels ({coding}) cannot be converted; convert it to H.264 first"
            ) from error
        height, width = image.shape[:2]
        if (width, height) != (info.width, info.height):
            self._scaled.add((width, height))
        return fitted(image, info.width, info.height)

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
        stated = stated_duration(self._decoder.stream, self.info.start)
        if stated is None or stated - duration <= max(2 / self.info.rate, stated * _SHORTFALL):
            return
        missing = round((stated - duration) * self.info.rate)
        if not self._decoder.losses.end(missing, self._decoder.container.size):
            self._faults.append(f"ends early: {frames} of {self.info.frames} frames could be read")

    def _judge(self) -> None:
        """Refuse the video if it is damaged too much, else warn of what is wrong with it."""
        damaged, total = self.damaged, self._decoder.losses.total
        if damaged:
            self._faults.insert(0, f"{damaged} of {total} frames damaged or lost")
        if damaged > self._tolerated * total:
            raise VideoError(
                f"{self.info.path}: {self._faults[0]}, more than input.max_damaged "
                f"({self._tolerated:g}) allows; raise it to take what is left"
            )
        jumped = self._decoder.losses.skipped
        if not damaged and jumped > _SHORTFALL * total:
            share = f"{jumped} of {total + jumped}"
            self._faults.append(f"times jump as if {share} frames were missing")
        if self._scaled:
            sizes = ", ".join(f"{width}×{height}" for width, height in sorted(self._scaled))
            self._faults.append(
                f"frames of {sizes} pixels scaled to {self.info.width}×{self.info.height}"
            )
        if self._faults:
            _log.warning("%s: %s", self.info.path, "; ".join(self._faults))

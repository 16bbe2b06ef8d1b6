"""Read a video: upright frames with their exact times."""

import itertools
import logging
import math
from collections.abc import Generator, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Self

import av
import cv2
import numpy as np
from av.filter import Graph
from av.video.stream import VideoStream

from vdet.boxes import Image
from vdet.config.schema import InputSettings
from vdet.errors import VideoError
from vdet.media import demux
from vdet.media.demux import Decoder
from vdet.media.frame import Coding, Frame, Picture, Planes, VideoInfo, bgr_of
from vdet.media.images import ASSUMED_RATE, Orientation, upright

_log = logging.getLogger("vdet")
_DEFAULTS = InputSettings()
_MAX_SIDE = 16_384  # pixels; H.264 cannot be written larger
_SLOW_MOTION = 1.5  # ratio of rates; in darkness, a camera may also record at a lower rate
_TOLERANCE = Fraction(1, 100)  # fraction of its duration that an intact file may lack


class VideoReader:
    """The frames of a video file, in order; a context manager. They can be read once.

    It yields the frames with ``start <= time < end``, at most `frames` of them. Seconds count from
    the first frame of the file, as in a player. Decoding begins at the key frame
    before `start` if the frames before it can be counted (see `Decoder`). Otherwise all frames are
    decoded, and those before `start` are dropped; the result is the same.

    The first video stream is read. Frames are rotated upright, and numbered images also mirrored,
    as the file says. HDR (PQ or HLG) is converted to BT.709. Frames of another size than the first
    are scaled to it. If the clock of a recording restarts, its parts follow one another. A time
    that is missing, or not later than the previous one, is estimated from the frame rate.

    Damaged packets are skipped. At the end, one warning (logger "vdet") reports the number of
    frames lost or damaged, an early end of the file, restarts of the clock, scaled frames, and
    unused video streams.

    Parameters
    ----------
    path
        The file, or numbered images such as `img_%04d.png`, without a gap.
    start, end
        Seconds after the file's first frame; None for no limit.
    frames
        Maximum number of frames; None for no limit.
    settings
        How much damage is tolerated, and the rate of numbered images or of a raw stream.

    Attributes
    ----------
    length
        Seconds from the first frame to the end of the last; None if unknown. It is the declared
        length until all frames are read.

    Raises
    ------
    VideoError
        The file is missing, is not a video, or no frame can be decoded; or `settings` has a rate
        that would change nothing. After the last frame: more frames were lost or damaged than
        `settings` tolerates.
    """

    def __init__(
        self,
        path: Path,
        *,
        start: Fraction | None = None,
        end: Fraction | None = None,
        frames: int | None = None,
        settings: InputSettings = _DEFAULTS,
    ) -> None:
        self._start, self._end, self._limit = start or Fraction(0), end, frames
        self._settings = settings
        self._faults: list[str] = []
        self._is_scaled = False
        self._decoder = Decoder(path, settings.frame_rate)
        if settings.frame_rate is not None and self._decoder.demuxer.has_own_rate:
            self._decoder.demuxer.close()
            raise VideoError(f"{path}: has a frame rate of its own; remove input.frame_rate")
        first = next(self._decoder.pictures, None)
        if first is None or max(first.width, first.height) > _MAX_SIDE:
            limits = f"{demux.MAX_PIXELS // 10**6} million pixels and sides of {_MAX_SIDE}"
            advice = f"use a file that plays, with frames of at most {limits}"
            raise VideoError(f"{path}: no frame can be decoded; {advice}")
        stream = self._decoder.stream
        demuxer = self._decoder.demuxer
        self.info: VideoInfo = demux.describe(path, demuxer, first)
        self.length: Fraction | None = None
        if demuxer.images:
            self.length = self.info.duration
        elif not (demuxer.may_restart or demuxer.is_raw):
            self.length = demux.stated_duration(stream, self.info.start)
        self._to_standard_range = _standard_range_filter(first.color_trc, stream)
        self._faults += self._assumptions()
        self._frames = self._deliver(self._begin(first))

    @property
    def damaged(self) -> int:
        """Number of frames lost or damaged so far."""
        return self._decoder.damage.damaged

    @property
    def expected(self) -> int | None:
        """The approximate number of frames; None if the file does not declare it."""
        if (last := self.info.frames) is None:
            return None
        if self._end is not None:
            last = min(last, math.ceil(self._end * self.info.rate))
        count = max(0, last - math.ceil(self._start * self.info.rate))
        return count if self._limit is None else min(count, self._limit)

    def __iter__(self) -> Iterator[Frame]:
        return self._frames

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._frames.close()
        self._decoder.demuxer.close()

    def _assumptions(self) -> Iterator[str]:
        """Yield assumptions that the user should know."""
        demuxer = self._decoder.demuxer
        if self._settings.frame_rate is None and not demuxer.has_own_rate:
            noun = "images" if demuxer.images else "frames"
            yield f"{ASSUMED_RATE} {noun} per second are assumed; set input.frame_rate"
        captured, shown = demux.capture_rate(demuxer.video) or 0, float(self.info.rate)
        if captured > _SLOW_MOTION * shown:
            rates = f"recorded at {captured:g} frames per second, shown at {shown:.3g}"
            yield f"is slow motion: {rates}; speeds are too low by this ratio"
        if demuxer.container.streams.audio and not self.info.has_audio:
            yield "its audio is dropped: a pipe can be read only once"
        streams = len(demux.moving_streams(demuxer.container))
        if streams > 1:
            yield f"has {streams} video streams; only the first is used"

    def _begin(self, first: av.VideoFrame) -> av.VideoFrame:
        """Return the picture at which decoding begins."""
        time = math.floor((self.info.start + self._start) / self.info.time_base)
        is_countable = self._decoder.is_countable and not first.interlaced_frame
        if not is_countable or first.pts is None or time <= first.pts:
            return first
        decoder = Decoder(self.info.path, self._settings.frame_rate)
        key = decoder.skip_to(time, first.pts)
        picture = None if key is None else next(decoder.pictures, None)
        # With intra refresh, the pictures after a key frame need older ones too.
        if picture is None or picture.pts != key or decoder.damage.is_evident:
            decoder.demuxer.close()
            return first
        self._decoder.demuxer.close()
        self._decoder = decoder
        return picture

    def _deliver(self, first: av.VideoFrame) -> Generator[Frame, None, None]:
        try:
            yield from itertools.islice(self._selected(first), self._limit)
            self._report()
        finally:
            self._decoder.demuxer.close()

    def _selected(self, first: av.VideoFrame) -> Iterator[Frame]:
        info, period, time = self.info, 1 / self.info.rate, None
        pictures = itertools.chain([first], self._decoder.pictures)
        are_numbers = bool(self._decoder.demuxer.images)  # the times of images
        for count, picture in enumerate(pictures, self._decoder.before):
            index = picture.pts if are_numbers and picture.pts is not None else count
            stated = None if picture.pts is None else picture.pts * info.time_base
            time = next_time(time, stated, period)
            since = time - info.start
            if self._end is not None and since >= self._end:
                return
            if since >= self._start:
                yield Frame(index, since, self._upright(picture))
        shown = max(period, picture.duration * info.time_base)
        declared, self.length = self.length, since + shown
        if declared and declared - self.length > max(2 * period, declared * _TOLERANCE):
            self._faults.append(f"ends early: {index + 1} of {info.frames} frames could be read")

    def _upright(self, picture: av.VideoFrame) -> Picture:
        """Return a picture as planes if they need no conversion, else as BGR."""
        info = self.info
        has_same_size = (picture.width, picture.height) == (info.width, info.height)
        is_ready = info.orientation == Orientation() and not self._to_standard_range
        if has_same_size and is_ready and Coding.of(picture) == info.coding:
            return Picture(Planes(picture, info.coding))
        return Picture(self._image(picture))

    def _image(self, picture: av.VideoFrame) -> Image:
        info = self.info
        try:
            if self._to_standard_range:
                self._to_standard_range.vpush(picture)
                picture = self._to_standard_range.vpull()
            image = bgr_of(picture)
        except (av.FFmpegError, ValueError) as error:
            fault = f"its pixels ({picture.format.name}) cannot be converted"
            raise VideoError(f"{info.path}: {fault}; convert it to H.264 first") from error
        image = upright(image, info.orientation)
        size = info.width, info.height
        if image.shape[1::-1] == size:
            return image
        self._is_scaled = True
        return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)

    def _report(self) -> None:
        """Raise `VideoError` if too much is damaged; warn about other faults."""
        damaged, total = self.damaged, self._decoder.damage.pictures + self._decoder.damage.lost
        if damaged:
            self._faults.insert(0, f"{damaged} of {total} frames damaged or lost")
        if damaged > math.ceil(self._settings.max_damaged * total):
            allowed = f"{self._settings.max_damaged:g}"
            limit = f"more than input.max_damaged: {allowed} allows; raise it, as in 0.5 for half"
            raise VideoError(f"{self.info.path}: {self._faults[0]}, {limit}")
        if restarts := self._decoder.demuxer.restarts:
            self._faults.append(f"its clock restarts {restarts}×; the parts follow one another")
        if self._is_scaled:
            self._faults.append("frames of other sizes are scaled to the first")
        if self._faults:
            _log.warning("%s: %s", self.info.path, "; ".join(self._faults))


def _standard_range_filter(transfer: int, stream: VideoStream) -> Graph | None:
    """Return the filter that converts HDR video to BT.709; None for other video."""
    if transfer not in demux.HDR_TRANSFERS:
        return None
    graph = Graph()
    colors = "out_transfer=bt709:out_primaries=bt709:out_color_matrix=bt709"
    graph.link_nodes(
        graph.add_buffer(template=stream),
        graph.add("scale", f"{colors}:intent=relative_colorimetric"),
        graph.add("format", "bgr24"),
        graph.add("buffersink"),
    ).configure()
    return graph


def next_time(last: Fraction | None, stated: Fraction | None, period: Fraction) -> Fraction:
    """Return the time of a frame, later than that of the previous frame, `last`; seconds.

    It is the `stated` time if that is later, else one period after the previous frame.
    """
    if last is None:
        return stated or Fraction(0)
    return last + period if stated is None or stated <= last else stated

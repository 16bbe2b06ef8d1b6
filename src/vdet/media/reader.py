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

from vdet.boxes import Image
from vdet.config.schema import InputSettings
from vdet.errors import VideoError
from vdet.media.coding import HDR_TRANSFERS, Coding, StandardRange
from vdet.media.decoder import Decoder
from vdet.media.demux import MAX_PIXELS, check_size, describe, moving_streams, stated_duration
from vdet.media.frame import Frame, Picture, Planes, VideoInfo, bgr_of
from vdet.media.images import Orientation, upright
from vdet.media.mp4 import joined_videos
from vdet.media.numbered import ASSUMED_RATE, find_sequence

_log = logging.getLogger("vdet")
_DEFAULTS = InputSettings()
_MAX_TICKS = 2**62
_TOLERANCE = Fraction(1, 100)  # share of its duration, or frames, that a whole file may lack


class VideoReader:
    """The frames of a video file, in order; a context manager. They can be read once.

    It gives the frames with ``start <= time - info.start < end``, and at most `frames` of them.
    Seconds count from the file's first frame, as in a player. Decoding begins at the key frame
    before `start` where the frames before it can be counted (see `Decoder`). Elsewhere all
    frames are decoded, and those before `start` are dropped. The frames given are the same.

    The first stream of moving pictures is read. Frames are turned upright, and mirrored where the
    file says so. HDR (PQ or HLG) is converted to BT.709. A frame of another size
    than the first is scaled to it. Where the clock of a recording restarts, its parts follow one
    another. A time that is missing, or not later than the one before, is guessed from the rate.
    Damaged packets are skipped. At the end, one warning (logger "vdet") says how many frames were
    lost or damaged, whether the file ends before its declared end, how often the clock restarts,
    which frames were scaled, and what of the file was not used (other video streams, HDR).

    Parameters
    ----------
    path
        The file; or numbered pictures, as `img_%04d.png`, from any number on, without a gap.
    start, end
        Seconds after the file's first frame; None for no limit.
    frames
        Most frames to give; None for no limit.
    settings
        How much damage is tolerated, and the rate of numbered pictures.

    Attributes
    ----------
    length
        Seconds from the first frame to the end of the last; None where that is not known. Before
        all frames were read it is what the file declares.

    Raises
    ------
    VideoError
        The file is missing, is not a video, or not one frame of it can be decoded. After the last
        frame: more of the frames read were lost or damaged than `settings` tolerates.
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
        self._tolerated = settings.max_damaged
        self._faults: list[str] = []
        self.length: Fraction | None = None
        self._scaled: set[tuple[int, int]] = set()
        self._frame_rate = settings.frame_rate
        self._decoder = Decoder(path, self._frame_rate)
        try:
            self._pictures = self._decoder.pictures()
            first = next(self._pictures, None)
            if first is None:
                raise VideoError(
                    f"{path}: not one frame can be decoded; give a file that plays, of at most "
                    f"{MAX_PIXELS // 10**6} million pixels a frame"
                )
            check_size(path, first.width, first.height)
            container, stream = self._decoder.container, self._decoder.stream
            self.info: VideoInfo = describe(path, container, stream, first)
            if not self._decoder.clock.may_restart:
                self.length = stated_duration(stream, self.info.start)
            hdr = first.color_trc in HDR_TRANSFERS
            self._standard_range = StandardRange(first.color_trc) if hdr else None
            self._faults += self._assumptions(first)
            self._frames = self._deliver(self._begin(first))
        except BaseException:
            self._decoder.close()
            raise

    @property
    def damaged(self) -> int:
        """Frames lost, or shown with errors, so far."""
        return self._decoder.damage.damaged

    @property
    def expected(self) -> int | None:
        """About how many frames there will be; None where the file does not say."""
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
        """Close the file; there are no more frames."""
        self._frames.close()
        self._decoder.close()

    def _assumptions(self, first: av.VideoFrame) -> Iterator[str]:
        """Yield what is read in another way than the file, or the user, may mean."""
        sequence = find_sequence(self.info.path)
        if sequence and sequence.step > 1:
            yield f"the numbers of its pictures rise by {sequence.step}"
        if sequence and self._frame_rate is None:
            yield f"{ASSUMED_RATE:.0f} pictures a second are assumed; --set input.frame_rate=N"
        if self._standard_range:
            name = HDR_TRANSFERS[first.color_trc]
            yield f"is HDR ({name}) and is read as standard range (BT.709)"
        streams = len(moving_streams(self._decoder.container))
        if streams > 1:
            yield f"has {streams} video streams; only the first is used"
        videos = joined_videos(self.info.path)
        if videos > 1:
            yield f"is {videos} videos joined to one file; only the first is sure to be read whole"

    def _begin(self, first: av.VideoFrame) -> av.VideoFrame:
        """Return the picture at which decoding begins."""
        time = min(math.floor((self.info.start + self._start) / self.info.time_base), _MAX_TICKS)
        is_countable = self._decoder.is_countable and not first.interlaced_frame
        if not is_countable or first.pts is None or time <= first.pts:
            return first
        decoder = Decoder(self.info.path, self._frame_rate)
        pictures = decoder.pictures()
        picture = next(pictures, None) if decoder.skip_to(time, first.pts) else None
        if picture is None or decoder.damage.is_evident:
            decoder.close()
            return first
        self._decoder.close()
        self._decoder, self._pictures = decoder, pictures
        return picture

    def _deliver(self, first: av.VideoFrame) -> Generator[Frame, None, None]:
        try:
            yield from itertools.islice(self._selected(first), self._limit)
            self._report()
        finally:
            self._decoder.close()

    def _selected(self, first: av.VideoFrame) -> Iterator[Frame]:
        for index, time, picture in self._timed(first):
            since = time - self.info.start
            if self._end is not None and since >= self._end:
                return
            if since >= self._start:
                yield Frame(index, time, self._upright(picture))

    def _upright(self, picture: av.VideoFrame) -> Picture:
        """Return a picture as its planes if these need no conversion, else as BGR."""
        info = self.info
        has_same_form = (
            info.orientation == Orientation()
            and not self._standard_range
            and Coding.of(picture) == info.coding
            and (picture.width, picture.height) == (info.width, info.height)
        )
        return Picture(Planes(picture, info.coding) if has_same_form else self._image(picture))

    def _image(self, picture: av.VideoFrame) -> Image:
        info = self.info
        try:
            image = bgr_of(picture)
        except (av.FFmpegError, ValueError) as error:
            pixels = picture.format.name
            raise VideoError(
                f"{info.path}: its pixels ({pixels}) cannot be converted; convert it to H.264 first"
            ) from error
        if self._standard_range:
            image = self._standard_range.convert(image)
        image = upright(image, info.orientation)
        height, width = image.shape[:2]
        if (width, height) == (info.width, info.height):
            return image
        self._scaled.add((width, height))
        size = info.width, info.height
        return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)

    def _timed(self, first: av.VideoFrame) -> Iterator[tuple[int, Fraction, av.VideoFrame]]:
        period = 1 / self.info.rate
        time = None
        pictures = itertools.chain([first], self._pictures)
        for index, picture in enumerate(pictures, self._decoder.before):
            stated = None if picture.pts is None else picture.pts * self.info.time_base
            time = next_time(time, stated, period)
            yield index, time, picture
        assert time is not None
        shown = max(period, picture.duration * self.info.time_base)
        declared, self.length = self.length, time + shown - self.info.start
        if declared and (lack := declared - self.length) > max(2 * period, declared * _TOLERANCE):
            self._end_early(index + 1, lack)
        if self._end is not None and self.length + period < self._end:
            end = f"{float(self._end):.2f} s"
            self._faults.append(f"ends at {float(self.length):.2f} s, before the end given, {end}")

    def _end_early(self, frames: int, lack: Fraction) -> None:
        """Note that `lack` seconds are missing at the end, after so many frames."""
        decoder = self._decoder
        if decoder.damage.goes_on(decoder.container.size):
            decoder.damage.lost_at_end += round(lack * self.info.rate)
        else:
            self._faults.append(f"ends early: {frames} of {self.info.frames} frames could be read")

    def _report(self) -> None:
        """Refuse a video that is too damaged; warn of any other fault."""
        damaged, total = self.damaged, self._decoder.damage.total
        if damaged:
            self._faults.insert(0, f"{damaged} of {total} frames damaged or lost")
        if damaged > math.ceil(self._tolerated * total):
            raise VideoError(
                f"{self.info.path}: {self._faults[0]}, more than input.max_damaged allows; raise it"
            )
        restarts = self._decoder.clock.restarts
        if restarts:
            times = "once" if restarts == 1 else f"{restarts} times"
            self._faults.append(f"its clock restarts {times}; the parts follow one another")
        if self._scaled:
            sizes = ", ".join(f"{width}×{height}" for width, height in sorted(self._scaled))
            self._faults.append(
                f"frames of {sizes} pixels scaled to {self.info.width}×{self.info.height}"
            )
        if self._faults:
            _log.warning("%s: %s", self.info.path, "; ".join(self._faults))


def next_time(last: Fraction | None, stated: Fraction | None, period: Fraction) -> Fraction:
    """Return the time of a frame, later than that of the frame before, `last`; in seconds.

    It is the `stated` one where that is so, else one frame period after the frame before.
    """
    if last is None:
        return stated or Fraction(0)
    return last + period if stated is None or stated <= last else stated

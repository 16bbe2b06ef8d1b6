"""Decode a video stream from its first picture, or from a key frame, despite damage."""

import itertools
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import av
from av.packet import Packet
from av.stream import Stream

from vdet.media import demux
from vdet.media.demux import Demuxer

_LONGEST_GROUP = 600  # maximum packets between key frames, which are kept in memory
_COUNTABLE = ("av1", "h264", "hevc", "libdav1d", "mjpeg", "mpeg2video", "mpeg4", "png", "vp9")
"""Codecs with one picture per packet."""
_LEADING = 17  # maximum pictures from a key packet to its picture, with those of an open group
_MAX_LATE = 32  # periods; a later picture means that the clock was set back
_FLAGGED = 2  # last packets of a part that seem incomplete where the next part begins


@dataclass(slots=True)
class Damage:
    """Counts errors, and corrupt and missing pictures, of one stream.

    Nothing counts as lost without evidence of damage: the first packets of an intact file may not
    yield pictures. With evidence, the number of lost pictures is that of errors, or of packets
    without a picture if this is larger.

    Attributes
    ----------
    period
        Time from one picture to the next, in units of the stream's time base.
    errors
        Unreadable parts of the file, and packets that cannot be decoded.
    restarts
        How often the clock restarts: the last packets before are flagged, but not corrupt.
    without_picture
        Packets without a picture, counted at the end of the stream.
    """

    period: Fraction
    errors: int = 0
    restarts: int = 0
    packets: int = 0
    pictures: int = 0
    corrupt_packets: int = 0
    without_picture: int = 0
    _corrupt_pictures: int = 0
    _last: int | None = None  # time of the last picture

    @property
    def is_evident(self) -> bool:
        """Whether there is evidence of damage."""
        return self.errors + self._corrupt_pictures + self._flagged > 0

    @property
    def lost(self) -> int:
        """Number of missing pictures."""
        return max(self.errors, self.without_picture * self.is_evident)

    @property
    def damaged(self) -> int:
        """Number of pictures lost or decoded with errors."""
        return max(self.lost + self._corrupt_pictures, self._flagged)

    @property
    def _flagged(self) -> int:
        return max(0, self.corrupt_packets - _FLAGGED * self.restarts)

    def receive(self, picture: av.VideoFrame) -> bool:
        """Count a picture; return whether it is usable.

        A late picture in a damaged stream is not usable, and counts as lost.
        """
        if self.is_evident and picture.pts is not None and self._last is not None:
            late = self._last - picture.pts
            if 0 <= late <= _MAX_LATE * self.period:
                return False
        self._last = picture.pts
        self.pictures += 1
        self._corrupt_pictures += picture.is_corrupt
        return True


class Decoder:
    """The pictures of the first video stream, in order of presentation.

    Parameters
    ----------
    frame_rate
        Rate of numbered images or of a raw stream, per second; None: as the stream says, else
        `ASSUMED_RATE`.

    Attributes
    ----------
    before
        Number of frames before the first picture.
    pictures
        The pictures that can be decoded.
    damage
        The damage so far.
    demuxer
        The file.
    is_countable
        Whether frames can be counted without decoding them.

    Raises
    ------
    VideoError
        The file cannot be read, or has no video stream.
    """

    def __init__(self, path: Path, frame_rate: float | None) -> None:
        self.before = 0
        self.demuxer = Demuxer(path, frame_rate)
        self.stream = self.demuxer.video
        context = self.stream.codec_context
        context.options = {"max_pixels": str(demux.MAX_PIXELS)}
        context.thread_count = 1  # with more, frames near damage differ from run to run
        self.damage = Damage(1 / self.demuxer.rate / demux.time_base_of(self.stream))
        self._times = deque[int]()  # of the packets of an AVI file that wait for their pictures
        self._is_avi = self.demuxer.container.format.name == "avi"
        self.is_countable = context.name in _COUNTABLE and not (self._is_avi or demux.is_pipe(path))
        self._packets = self._read()
        self.pictures = self._decode()

    @property
    def lacks_shown_times(self) -> bool:
        """Whether the packets have no presentation times: in AVI files with B-frames."""
        return self._is_avi and self.stream.codec_context.has_b_frames

    def skip_to(self, time: int, first: int) -> int | None:
        """Begin at the last key frame at or before a time, and count the frames before it.

        Parameters
        ----------
        time, first
            This time, and the time of the first frame, in units of the time base.

        Returns
        -------
        The time of the key frame. None if the frames cannot be counted without decoding them:
        packets have no times or are damaged, or key frames are very rare. The decoder is then
        unusable.
        """
        group: list[Packet[Stream]] = []
        key, times = first, list[int]()
        for packet in self._packets:
            is_damaged = packet.is_corrupt or self.damage.errors
            if packet.pts is None or is_damaged or len(group) > _LONGEST_GROUP:
                return None
            if packet.is_keyframe and packet.pts <= time:
                key, group = packet.pts, []
            group.append(packet)
            if not packet.is_discard:  # otherwise the file marks it as hidden
                times.append(packet.pts)
            if packet.dts is not None and packet.dts > time:
                break
        self.before = sum(first <= pts < key for pts in times)
        following = itertools.chain(group, self._packets)
        # Pictures before the key frame may need older ones.
        self._packets = (packet for packet in following if packet.pts is None or packet.pts >= key)
        return key

    def shows_key_frame(self) -> bool:
        """Decode from the second key frame, and return whether it is shown; True without one.

        With intra refresh, it is not. The decoder is then unusable.
        """
        keys = (packet for packet in self._packets if packet.is_keyframe)
        key = next(itertools.islice(keys, 1, None), None)
        if key is None:
            return True
        self._packets = itertools.chain([key], self._packets)
        shown = itertools.islice(self.pictures, _LEADING)
        return key.pts is not None and any(picture.pts == key.pts for picture in shown)

    def _decode(self) -> Iterator[av.VideoFrame]:
        for packet in itertools.chain(self._packets, (None,)):
            if packet and not packet.is_discard:  # otherwise the file marks it as hidden
                self.damage.packets += 1
            try:
                decoded = self.stream.codec_context.decode(packet)
            except av.FFmpegError:
                self._fail()
                if self._times:
                    self._times.pop()
            else:
                yield from filter(self.damage.receive, self._timed(decoded))
        if self.is_countable:
            self.damage.without_picture = self.damage.packets - self.damage.pictures

    def _timed(self, pictures: list[av.VideoFrame]) -> Iterator[av.VideoFrame]:
        """Yield pictures with their times; those of AVI are sorted, for lack of presentation times.

        AVI counts its empty packets too.
        """
        for picture in pictures:
            if self.lacks_shown_times:
                picture.pts = self._times.popleft() if self._times else None
            yield picture

    def _read(self) -> "Iterator[Packet[Stream]]":
        """Yield the packets of the pictures."""
        for packet in self.demuxer.packets([self.stream], self._fail):
            if self.lacks_shown_times:
                packet.pts = packet.dts
                self._times += [] if packet.dts is None else [packet.dts]
            if self.demuxer.is_raw:
                packet.pts = packet.dts = packet.duration = None  # those of FFmpeg are assumed
            self.damage.corrupt_packets += packet.is_corrupt
            self.damage.restarts = self.demuxer.restarts
            yield packet

    def _fail(self) -> None:
        self.damage.errors += 1

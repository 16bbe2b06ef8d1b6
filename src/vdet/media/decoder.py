"""Decode a picture stream from its first picture, or from a key frame, despite damage."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain, pairwise
from pathlib import Path

import av
from av.container import InputContainer
from av.packet import Packet
from av.stream import Discard, Stream
from av.video.stream import VideoStream

from vdet.media.demux import MAX_PIXELS, check_size, is_pipe, open_input, period_of, picture_stream
from vdet.media.restarts import continuous_packets, restarts_clock

_HOLE = 256  # bytes; what lies between two packets of a whole Matroska file is far less
_MAX_LATE = 32  # periods; a picture later than that follows a clock that was set back
_REGULAR = Fraction(4, 5)  # share of the steps that must be one period


@dataclass(slots=True)
class Damage:
    """Counts the pictures of one stream that are lost, or decoded with errors.

    Nothing is lost before there is evidence of damage: a whole file may leave pictures out (frames
    that a camera dropped, packets that hold no picture). With evidence, the number lost is the
    largest of three: errors, packets that gave no picture, and pictures missing between the times
    of others.

    Attributes
    ----------
    period
        Time from one picture to the next, in units of the stream's time base.
    paired
        Whether every packet makes one picture.
    """

    period: Fraction
    paired: bool
    evident: bool = False
    packets: int = 0
    corrupt_packets: int = 0
    pictures: int = 0
    corrupt_pictures: int = 0
    errors: int = 0
    without_picture: int = 0  # packets
    lost_at_end: int = 0
    _last: int | None = None  # time of a picture
    _steps: int = 0
    _regular_steps: int = 0
    _skipped: int = 0
    _read_to: int | None = None  # byte of the file
    _largest: int = _HOLE  # packet, bytes

    @property
    def lost(self) -> int:
        """Pictures that should be there and are not."""
        is_regular = self._regular_steps >= _REGULAR * self._steps
        skipped = self._skipped if is_regular else 0
        missing = max(self.errors, self.without_picture, skipped) if self.evident else 0
        return missing + self.lost_at_end

    @property
    def damaged(self) -> int:
        """Pictures lost, and pictures decoded with errors."""
        return max(self.lost + self.corrupt_pictures, self.corrupt_packets)

    @property
    def total(self) -> int:
        """Pictures that came, and those lost."""
        return self.pictures + self.lost

    def fail(self) -> None:
        """Count a place in the file that cannot be read, or a packet that cannot be decoded."""
        self.errors += 1
        self.evident = True

    def pass_bytes(self, position: int, size: int) -> None:
        """Note where in the file a packet of any stream lies.

        A hole between two packets may be damage, or data of another kind, such as transparency.
        Whether pictures were lost in it shows in their times.
        """
        if self._read_to is not None and position - self._read_to > _HOLE:
            self.evident = True
        self._read_to = max(self._read_to or 0, position + size)
        self._largest = max(self._largest, size)

    def send(self, packet: "Packet[Stream]") -> None:
        """Count a packet of the stream."""
        self.packets += not packet.is_discard  # else the file says that it is not shown
        self.corrupt_packets += packet.is_corrupt
        self.evident |= packet.is_corrupt

    def receive(self, picture: av.VideoFrame) -> bool:
        """Count a picture; return whether it is usable.

        One that comes late, where there is damage, is not usable: it counts as lost.
        """
        if self.evident and self._is_late(picture.pts):
            return False
        self.pictures += 1
        self.corrupt_pictures += picture.is_corrupt
        self.evident |= picture.is_corrupt
        self.paired &= not picture.interlaced_frame  # each of two fields may have a packet
        if picture.pts is not None:
            self._step_to(picture.pts)
        return True

    def finish(self) -> None:
        """Note that no more pictures will come."""
        if self.paired:
            self.without_picture = self.packets - self.pictures

    def end(self, missing: int, file_size: int) -> bool:
        """Count `missing` pictures as lost if the file goes on, unreadable, after the last packet.

        Return whether it does. A file that was cut off ends within a packet.
        """
        goes_on = self._read_to is not None and file_size - self._read_to > 2 * self._largest
        self.lost_at_end += missing * goes_on
        return goes_on

    def _is_late(self, time: int | None) -> bool:
        if time is None or self._last is None:
            return False
        return 0 <= self._last - time <= _MAX_LATE * self.period

    def _step_to(self, time: int) -> None:
        if self._last is None:
            self._last = time
            return
        step = time - self._last
        self._steps += 1
        self._regular_steps += abs(step - self.period) <= max(Fraction(1), self.period / 20)
        if not self._is_late(time):
            self._last = time
            self._skipped += max(0, round(step / self.period) - 1) * self.evident


_LARGEST_GROUP = 64_000_000  # bytes from one key frame to the next, which are held in memory
_REORDERED = ("h264", "hevc")
_ONE_PICTURE_PER_PACKET = frozenset((
    "av1", "ffv1", "h264", "hevc", "libdav1d", "mjpeg", "mpeg1video", "mpeg2video", "mpeg4", "png",
    "prores", "vp9",
))  # fmt: skip


class UncountableError(Exception):
    """The frames before a time cannot be counted without decoding them."""


class Decoder:
    """The pictures of the first stream of moving pictures, in order of presentation.

    Parameters
    ----------
    frame_rate
        Of numbered pictures, per second; None: `ASSUMED_RATE`.
    span
        Times of the first frame, and of a later one, in units of the time base: begin at the last
        key frame that is not after the later one. None: begin at the first picture.

    Attributes
    ----------
    before
        Number of frames that are shown before the first picture.

    Raises
    ------
    VideoError
        The file cannot be read, has no moving pictures, or its frames are too large.
    """

    def __init__(
        self, path: Path, frame_rate: float | None, span: tuple[int, int] | None = None
    ) -> None:
        self._span = span
        self.before = 0
        self.container, self.stream = _open(path, frame_rate)
        form, codec = self.container.format.name, self.stream.codec_context.name
        # In Matroska, damage shows only as a hole between the packets of all streams. Where the
        # clock may restart, the sound is read too.
        self._all_streams = "matroska" in form
        if not self._all_streams and not restarts_clock(self.container):
            for other in self.container.streams:
                if other is not self.stream:
                    other.discard = Discard.all
        self.restarts = 0  # of the clock
        # AVI has no times of presentation: pictures take those of decoding, in their order.
        self._in_order = form == "avi" and codec in _REORDERED
        self._times: deque[int] = deque()
        self.is_countable = codec in _ONE_PICTURE_PER_PACKET and form != "avi" and not is_pipe(path)
        self.damage = Damage(period_of(self.stream), paired=codec in _ONE_PICTURE_PER_PACKET)

    def pictures(self) -> Iterator[av.VideoFrame]:
        """Yield the pictures that can be decoded.

        With a `span`, raise `UncountableError` before the first one where the frames before it
        cannot be counted: packets have no times, are damaged, or key frames are very rare.
        """
        for packet in chain(self._packets(), [None]):
            for picture in self._decode(packet):
                if self._times:
                    picture.pts = self._times.popleft()
                if self.damage.receive(picture):
                    yield picture
        self.damage.finish()

    def close(self) -> None:
        """Close the file."""
        self.container.close()

    def _packets(self) -> "Iterator[Packet[Stream]]":
        found = self._read()
        if self._span:
            found = self._from_key_frame(found, *self._span)
        for packet, following in pairwise(chain(found, [None])):
            if packet is None:
                return
            if following is None and packet.is_corrupt:
                self.damage.lost_at_end = 1
                return
            self.damage.send(packet)
            if self._in_order and packet.dts is not None:
                self._times.append(packet.dts)
            yield packet

    def _read(self) -> "Iterator[Packet[Stream]]":
        others = tuple(self.container.streams) if self._all_streams else ()
        for packet in continuous_packets(
            self.container,
            self.stream,
            *others,
            on_error=self.damage.fail,
            on_restart=self._count_restart,
        ):
            if self._all_streams and packet.pos is not None:
                self.damage.pass_bytes(packet.pos, packet.size)
            if packet.stream_index == self.stream.index:
                yield packet

    def _from_key_frame(
        self, found: "Iterator[Packet[Stream]]", first: int, time: int
    ) -> "Iterator[Packet[Stream]]":
        """Leave out the packets before the last key frame that is not after `time`."""
        group: list[Packet[Stream]] = []
        key, held, times = first, 0, list[int]()
        for packet in found:
            is_sure = not (packet.is_corrupt or self.damage.evident or held > _LARGEST_GROUP)
            if packet.pts is None or not is_sure:
                raise UncountableError
            if packet.is_keyframe and packet.pts <= time:
                key, held, group = packet.pts, 0, []
            held += packet.size
            group.append(packet)
            if not packet.is_discard:
                times.append(packet.pts)
            if packet.dts is not None and packet.dts > time:
                break
        self.before = sum(first <= each < key for each in times)
        for packet in chain(group, found):
            # What is shown before the key frame may need older pictures.
            if packet.pts is None or packet.pts >= key:
                yield packet

    def _count_restart(self) -> None:
        self.restarts += 1

    def _decode(self, packet: "Packet[Stream] | None") -> list[av.VideoFrame]:
        """Return the pictures that the decoder has ready; for None, all that are left."""
        try:
            return self.stream.codec_context.decode(packet)
        except av.FFmpegError:
            self.damage.fail()
            return []


def _open(path: Path, frame_rate: float | None) -> tuple[InputContainer, VideoStream]:
    container = open_input(path, frame_rate)
    try:
        stream = picture_stream(container, path)
        context = stream.codec_context
        check_size(path, context.width, context.height)
    except BaseException:
        container.close()
        raise
    context.options = {"max_pixels": str(MAX_PIXELS)}
    context.thread_count = 1  # with more, frames near damage differ from run to run
    return container, stream

"""Decode a picture stream from its first picture, or from a key frame, despite damage."""

from collections import deque
from collections.abc import Iterator
from contextlib import closing
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
    is_cut_off: bool = False  # within its last packet
    _last: int | None = None  # time of a picture
    _steps: int = 0
    _regular_steps: int = 0
    _skipped: int = 0
    _read_to: int | None = None  # byte of the file

    @property
    def lost(self) -> int:
        """Pictures that should be there and are not."""
        is_regular = self._regular_steps >= _REGULAR * self._steps
        skipped = self._skipped if is_regular else 0
        missing = max(self.errors, self.without_picture, skipped) if self.evident else 0
        return missing + self.is_cut_off

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

    def _is_late(self, time: int | None) -> bool:
        if time is None or self._last is None:
            return False
        return time <= self._last <= time + _MAX_LATE * self.period

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


_WITH_HIDDEN_PACKETS = ("vp8", "libvpx")  # decoders of codecs with packets that show no picture
_REORDERED = ("h264", "hevc")
_ONE_PICTURE_PER_PACKET = frozenset((
    "av1", "h264", "hevc", "libdav1d", "mjpeg", "mpeg1video", "mpeg2video", "mpeg4", "png", "vp9",
))  # fmt: skip


@dataclass(frozen=True, slots=True)
class Entry:
    """A key frame from which all later frames can be decoded.

    Attributes
    ----------
    pts
        Its time, in units of the time base.
    index
        Number of frames shown before it.
    """

    pts: int
    index: int


class Decoder:
    """The pictures of the first stream of moving pictures, in order of presentation.

    Parameters
    ----------
    frame_rate
        Of numbered pictures, per second; None: `ASSUMED_RATE`.
    entry
        Where to begin; None: at the first picture.

    Raises
    ------
    VideoError
        The file cannot be read, has no moving pictures, or its frames are too large.
    """

    def __init__(
        self,
        path: Path,
        frame_rate: float | None,
        entry: Entry | None = None,
    ) -> None:
        self._entry = entry
        self.container, self.stream = _open(path, frame_rate)
        # In Matroska, damage shows only as a hole between the packets of all streams.
        self._all_streams = "matroska" in self.container.format.name
        self.restarts = 0  # of the clock
        if not self._all_streams:
            _discard_others(self.container, self.stream)
        codec = self.stream.codec_context.name
        # AVI has no times of presentation: pictures take those of decoding, in their order.
        self._in_order = self.container.format.name == "avi" and codec in _REORDERED
        self._times: deque[int] = deque()
        paired = codec not in _WITH_HIDDEN_PACKETS
        self.damage = Damage(period_of(self.stream), paired=paired)

    def pictures(self) -> Iterator[av.VideoFrame]:
        """Yield the pictures that can be decoded."""
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
        for packet, following in pairwise(chain(self._read(), [None])):
            if packet is None:
                return
            if following is None and packet.is_corrupt:
                self.damage.is_cut_off = True
                return
            self.damage.send(packet)
            if self._in_order and packet.dts is not None:
                self._times.append(packet.dts)
            yield packet

    def _read(self) -> "Iterator[Packet[Stream]]":
        entry = self._entry
        waits = entry is not None
        others = tuple(self.container.streams) if self._all_streams else ()
        for packet in continuous_packets(
            self.container,
            self.stream,
            *others,
            on_error=self.damage.fail,
            on_restart=self._count_restart,
        ):
            is_picture = packet.stream_index == self.stream.index
            if entry and waits and is_picture:
                waits = packet.pts != entry.pts or not packet.is_keyframe
            if waits:
                continue
            if self._all_streams and packet.pos is not None:
                self.damage.pass_bytes(packet.pos, packet.size)
            # What is shown before the entry may need older pictures.
            if is_picture and not (entry and packet.pts is not None and packet.pts < entry.pts):
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


def find_entry(
    path: Path, first: av.VideoFrame, time: int, frame_rate: float | None
) -> Entry | None:
    """Return the last key frame that is not after `time`, by reading the packets before it.

    Parameters
    ----------
    first
        The first frame of the file.
    time
        In units of the time base.

    Returns
    -------
    None where the frames before it cannot be counted for sure: in interlaced video, for other
    codecs than those of `_ONE_PICTURE_PER_PACKET`, in AVI, without times, after damage, and in
    pipes.
    """
    if first.pts is None or time <= first.pts or first.interlaced_frame or is_pipe(path):
        return None
    container, stream = _open(path, frame_rate)
    with closing(container):
        codec, form = stream.codec_context.name, container.format.name
        if codec not in _ONE_PICTURE_PER_PACKET or form == "avi":
            return None
        _discard_others(container, stream)
        return _last_key_frame(container, stream, first.pts, time)


def _last_key_frame(
    container: InputContainer, stream: VideoStream, first: int, time: int
) -> Entry | None:
    errors: list[None] = []
    times: list[int] = []
    key: int | None = None
    found = continuous_packets(container, stream, on_error=lambda: errors.append(None))
    for packet in (each for each in found if each.stream_index == stream.index):
        if packet.pts is None or packet.is_corrupt or errors:
            return None
        if packet.dts is not None and packet.dts > time:
            break
        if packet.is_keyframe and packet.pts <= time:
            key = packet.pts
        if not packet.is_discard:
            times.append(packet.pts)
    return None if key is None else Entry(key, sum(first <= each < key for each in times))


def _discard_others(container: InputContainer, stream: VideoStream) -> None:
    """Leave out what is not read; where the clock may restart, the sound is read too."""
    if not restarts_clock(container):
        for other in container.streams:
            if other is not stream:
                other.discard = Discard.all


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

"""Decode a picture stream from its first picture, or from a key frame, in spite of damage."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from itertools import chain, pairwise
from pathlib import Path

import av
from av.container import InputContainer
from av.packet import Packet
from av.stream import Discard, Stream
from av.video.stream import VideoStream

from vdet.media.damage import Damage
from vdet.media.demux import MAX_PIXELS, is_pipe, open_input
from vdet.media.probe import check_size, period_of, picture_stream
from vdet.media.restarts import continuous_packets, restarts_clock

_WITH_HIDDEN_PACKETS = ("vp8", "libvpx")  # decoders of codecs with packets that show no picture
_WITHOUT_FRAME_THREADS = ("vp8", "vp9", "mpeg4")  # they would hide some errors
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
    packets
        Number of packets of the stream before it in the file.
    """

    pts: int
    index: int
    packets: int


class Decoder:
    """The pictures of the first stream of moving pictures, in order of presentation.

    Parameters
    ----------
    threads
        Of the decoder; None lets it choose.
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
        *,
        threads: int | None,
        frame_rate: float | None,
        entry: Entry | None = None,
    ) -> None:
        self._entry = entry
        self.container, self.stream = _open(path, frame_rate, threads or 0)
        # In Matroska, damage shows only as a hole between the packets of all streams.
        self._all_streams = "matroska" in self.container.format.name
        self.restarts = 0  # of the clock
        if not self._all_streams:
            _discard_others(self.container, self.stream)
        paired = self.stream.codec_context.name not in _WITH_HIDDEN_PACKETS
        self.damage = Damage(period_of(self.stream), paired=paired)

    def pictures(self) -> Iterator[av.VideoFrame]:
        """Yield the pictures that can be decoded."""
        for packet in chain(self._packets(), [None]):
            for picture in self._decode(packet):
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
            if following is None and packet.is_corrupt:  # the file was cut off within it
                self.damage.lost_at_end = 1
            else:
                self.damage.send(packet)
                yield packet

    def _read(self) -> "Iterator[Packet[Stream]]":
        skipped = self._entry.packets if self._entry else 0
        others = tuple(self.container.streams) if self._all_streams else ()
        for packet in continuous_packets(
            self.container,
            self.stream,
            *others,
            on_error=self.damage.fail_to_read,
            on_restart=self._count_restart,
        ):
            is_picture = packet.stream_index == self.stream.index
            if skipped:
                skipped -= is_picture
                continue
            if self._all_streams and packet.pos is not None:
                self.damage.pass_bytes(packet.pos, packet.size)
            if is_picture and not self._needs_older_ones(packet):
                yield packet

    def _needs_older_ones(self, packet: "Packet[Stream]") -> bool:
        """Return whether a picture is shown before the key frame at which decoding began."""
        return bool(self._entry and packet.pts is not None and packet.pts < self._entry.pts)

    def _count_restart(self) -> None:
        self.restarts += 1

    def _decode(self, packet: "Packet[Stream] | None") -> list[av.VideoFrame]:
        """Return the pictures that the decoder has ready; for None, all that are left."""
        try:
            return self.stream.codec_context.decode(packet)
        except av.FFmpegError:
            self.damage.fail_to_decode()
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
    codecs than those of `_ONE_PICTURE_PER_PACKET`, without times, after damage, and in pipes.
    """
    if first.pts is None or time <= first.pts or first.interlaced_frame or is_pipe(path):
        return None
    container, stream = _open(path, frame_rate, 1)
    with closing(container):
        if stream.codec_context.name not in _ONE_PICTURE_PER_PACKET:
            return None
        _discard_others(container, stream)
        return _last_key_frame(container, stream, first.pts, time)


def _last_key_frame(
    container: InputContainer, stream: VideoStream, first: int, time: int
) -> Entry | None:
    errors: list[None] = []
    times: list[int] = []
    key: tuple[int, int] | None = None
    found = continuous_packets(container, stream, on_error=lambda: errors.append(None))
    for number, packet in enumerate(each for each in found if each.stream_index == stream.index):
        if packet.pts is None or packet.is_corrupt or errors:
            return None
        if packet.dts is not None and packet.dts > time:
            break
        if packet.is_keyframe and packet.pts <= time:
            key = number, packet.pts
        if not packet.is_discard:
            times.append(packet.pts)
    if key is None:
        return None
    number, pts = key
    return Entry(pts, sum(first <= each < pts for each in times), number)


def _discard_others(container: InputContainer, stream: VideoStream) -> None:
    """Leave out what is not read; where the clock may restart, the sound is read too."""
    if not restarts_clock(container):
        for other in container.streams:
            if other is not stream:
                other.discard = Discard.all


def _open(path: Path, frame_rate: float | None, threads: int) -> tuple[InputContainer, VideoStream]:
    container = open_input(path, frame_rate)
    try:
        stream = picture_stream(container, path)
        context = stream.codec_context
        check_size(path, context.width, context.height)
    except BaseException:
        container.close()
        raise
    context.options = {"max_pixels": str(MAX_PIXELS)}
    context.thread_type = "SLICE" if context.name in _WITHOUT_FRAME_THREADS else "AUTO"
    context.thread_count = threads
    return container, stream

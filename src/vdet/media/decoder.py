"""Decode a picture stream from its first picture, or from a key frame, despite damage."""

from collections import deque
from collections.abc import Iterator
from itertools import chain, pairwise
from pathlib import Path

import av
from av.packet import Packet
from av.stream import Stream

from vdet.media.clock import ClockUnwrapper
from vdet.media.damage import Damage
from vdet.media.demux import (
    MAX_PIXELS,
    check_size,
    is_pipe,
    open_input,
    packets,
    period_of,
    picture_stream,
)

_LARGEST_GROUP = 64_000_000  # bytes from one key frame to the next, which are held in memory
_REORDERED = ("h264", "hevc")
_ONE_PICTURE_PER_PACKET = frozenset((
    "av1", "ffv1", "h264", "hevc", "libdav1d", "mjpeg", "mpeg1video", "mpeg2video", "mpeg4", "png",
    "prores", "vp9",
))  # fmt: skip


class Decoder:
    """The pictures of the first stream of moving pictures, in order of presentation.

    Parameters
    ----------
    frame_rate
        Of numbered pictures, per second; None: `ASSUMED_RATE`.

    Attributes
    ----------
    before
        Number of frames that are shown before the first picture.
    damage
        What was damaged so far.
    clock
        Says whether, and how often, the clock restarts.

    Raises
    ------
    VideoError
        The file cannot be read, has no moving pictures, or its frames are too large.
    """

    def __init__(self, path: Path, frame_rate: float | None) -> None:
        self.before = 0
        self.container = open_input(path, frame_rate)
        try:
            self.stream = picture_stream(self.container, path)
            context = self.stream.codec_context
            check_size(path, context.width, context.height)
        except BaseException:
            self.container.close()
            raise
        context.options = {"max_pixels": str(MAX_PIXELS)}
        context.thread_count = 1  # with more, frames near damage differ from run to run
        self.clock = ClockUnwrapper(self.container, self.stream)
        form = self.container.format.name
        self._is_matroska = "matroska" in form
        # AVI has no times of presentation: pictures take those of decoding, in their order.
        self._takes_decoding_times = form == "avi" and context.name in _REORDERED
        self._decoding_times: deque[int] = deque()
        is_paired = context.name in _ONE_PICTURE_PER_PACKET
        self.damage = Damage(period_of(self.stream), is_paired)
        self.is_countable = is_paired and form != "avi" and not is_pipe(path)
        self._packets = self._read()

    def skip_to(self, time: int, first: int) -> bool:
        """Begin at the last key frame that is not after a time, and count the frames before it.

        Parameters
        ----------
        time, first
            That time, and the time of the first frame, in units of the time base.

        Returns
        -------
        False where the frames cannot be counted without decoding them: packets have no times, or
        are damaged, or key frames are very rare. The decoder is then of no more use.
        """
        group: list[Packet[Stream]] = []
        key, held, times = first, 0, list[int]()
        for packet in self._packets:
            is_sure = not (packet.is_corrupt or self.damage.is_evident or held > _LARGEST_GROUP)
            if packet.pts is None or not is_sure:
                return False
            if packet.is_keyframe and packet.pts <= time:
                key, held, group = packet.pts, 0, []
            held += packet.size
            group.append(packet)
            if not packet.is_discard:  # else the file says that it is not shown
                times.append(packet.pts)
            if packet.dts is not None and packet.dts > time:
                break
        self.before = sum(first <= each < key for each in times)
        following = chain(group, self._packets)
        # What is shown before the key frame may need older pictures.
        self._packets = (each for each in following if each.pts is None or each.pts >= key)
        return True

    def pictures(self) -> Iterator[av.VideoFrame]:
        """Yield the pictures that can be decoded."""
        for packet, following in pairwise(chain(self._packets, (None, None))):
            if packet and packet.is_corrupt and following is None:  # the file was cut off in it
                self.damage.lost_at_end = 1
                continue
            for picture in self._decode(packet):
                if self._decoding_times:
                    picture.pts = self._decoding_times.popleft()
                if self.damage.receive(picture):
                    yield picture
        self.damage.finish()

    def close(self) -> None:
        """Close the file."""
        self.container.close()

    def _read(self) -> "Iterator[Packet[Stream]]":
        """Yield the packets of the pictures.

        In Matroska, damage shows only as a hole between the packets of all streams.
        """
        streams = self.container.streams if self._is_matroska else self.clock.streams
        found = packets(self.container, streams, on_error=self.damage.fail)
        for packet in self.clock.unwrap(found):
            if self._is_matroska and packet.pos is not None:
                self.damage.pass_bytes(packet.pos, packet.size)
            if packet.stream_index == self.stream.index:
                yield packet

    def _decode(self, packet: "Packet[Stream] | None") -> list[av.VideoFrame]:
        """Return the pictures that the decoder has ready; for None, all that are left."""
        if packet:
            self.damage.send(packet)
            if self._takes_decoding_times and packet.dts is not None:
                self._decoding_times.append(packet.dts)
        try:
            return self.stream.codec_context.decode(packet)
        except av.FFmpegError:
            self.damage.fail()
            return []

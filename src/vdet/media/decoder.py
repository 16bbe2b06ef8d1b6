"""Decode a picture stream from end to end, in spite of damage."""

import contextlib
from collections.abc import Iterable, Iterator
from functools import partial
from itertools import chain, dropwhile, pairwise
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
from vdet.media.seek import Entry, find_entry

_WITH_HIDDEN_PACKETS = ("vp8", "libvpx")  # decoders of codecs with packets that show no picture
_MAX_RECENT = 500  # packets; key frames further apart than that are rare
_WITHOUT_FRAME_THREADS = ("vp8", "vp9", "mpeg4")  # they would hide some errors


class Decoder:
    """The pictures of the first stream of moving pictures, in order of presentation.

    Several threads decode several pictures at once until there is damage. Then a single thread goes
    on, from a key frame before the damage. So the pictures, and the number counted as lost, hardly
    depend on the number of threads. What can be read only once (a FIFO) has a single thread.

    Parameters
    ----------
    threads
        Of the decoder; None lets it choose.
    frame_rate
        Of numbered pictures, per second; None: `ASSUMED_RATE`.
    entry
        Where to begin; None for the first picture.

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
        self._open = partial(_open, path, frame_rate)
        self._opens_once = opens_once = is_pipe(path)
        self._entry = entry
        self.container, self.stream = self._open(1 if opens_once else threads or 0)
        self._opened = [self.container]
        self._context = self.stream.codec_context
        # The packets from the last key frame that was shown on, and the times shown since then.
        self._recent: list[Packet[Stream]] | None = None if opens_once else []
        self._shown: list[int | None] = []
        # In Matroska, damage shows only as a hole between the packets of all streams.
        self._all_streams = "matroska" in self.container.format.name
        self.restarts = 0  # of the clock
        if not self._all_streams:
            _discard_others(self.container, self.stream)
        if entry and entry.target is not None:
            self.container.seek(entry.target, stream=self.stream)
        paired = self._context.name not in _WITH_HIDDEN_PACKETS
        self.damage = Damage(period_of(self.stream), paired=paired)

    def pictures(self) -> Iterator[av.VideoFrame]:
        """Yield the pictures that can be decoded."""
        for packet in chain(self._packets(), [None]):
            for picture in self._decode(packet):
                if self._is_new(picture) and self.damage.receive(picture):
                    yield picture
        self.damage.finish()

    def find_entry(self, first: av.VideoFrame, time: int) -> Entry | None:
        """Return where a decoder may begin that needs no picture before `time`.

        `first` is the first picture, and `time` is in units of the time base. None: at the first.
        """
        if self._opens_once:
            return None
        container, stream = self._open(1)
        with contextlib.closing(container):
            _discard_others(container, stream)
            return find_entry(container, stream, first, time)

    def close(self) -> None:
        """Close the file."""
        for container in self._opened:
            container.close()

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

    def _decode(self, packet: "Packet[Stream] | None") -> Iterable[av.VideoFrame]:
        """Return the pictures that the decoder has ready; for None, all that are left."""
        pictures = self._attempt(packet)
        if self._recent is None:
            return pictures
        if packet is not None:
            self._recent.append(packet)
        damaged = self.damage.evident or any(picture.is_corrupt for picture in pictures)
        if packet is None and self.damage.paired:  # several threads hide errors at the end
            damaged |= len(self._recent) > len(self._shown) + len(pictures)
        if damaged:
            return self._decode_again(self._recent, at_end=packet is None)
        if len(self._recent) > _MAX_RECENT:
            self._recent = None
            self._shown.clear()
        return pictures

    def _decode_again(
        self, recent: "list[Packet[Stream]]", *, at_end: bool
    ) -> Iterator[av.VideoFrame]:
        self._recent = None
        container, stream = self._open(1)
        self._opened.append(container)
        self._context = stream.codec_context
        self.damage.decode_errors = 0  # those packets are tried again
        for packet in chain(recent, [None] * at_end):
            yield from self._attempt(packet)

    def _attempt(self, packet: "Packet[Stream] | None") -> list[av.VideoFrame]:
        try:
            return self._context.decode(packet)
        except av.FFmpegError:
            self.damage.fail_to_decode()
            return []

    def _is_new(self, picture: av.VideoFrame) -> bool:
        """Return whether a picture was not shown yet."""
        if self._recent is not None:
            self._remember(self._recent, picture)
        elif picture.pts in self._shown:
            self._shown.remove(picture.pts)
            return False
        return True

    def _remember(self, recent: "list[Packet[Stream]]", picture: av.VideoFrame) -> None:
        for index, key in enumerate(recent if picture.key_frame else []):
            if key.is_keyframe and key.pts == picture.pts is not None:
                # Packets right after the key frame that are shown before it need older ones.
                recent[:] = [key, *dropwhile(partial(_is_before, key), recent[index + 1 :])]
                self._shown.clear()
                break
        self._shown.append(picture.pts)


def _is_before(key: "Packet[Stream]", packet: "Packet[Stream]") -> bool:
    return key.pts is not None and packet.pts is not None and packet.pts < key.pts


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

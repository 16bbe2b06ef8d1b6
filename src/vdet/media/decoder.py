"""Decode a picture stream from end to end, whatever is damaged in it."""

from collections.abc import Iterator
from functools import partial
from itertools import chain
from pathlib import Path

import av
from av.container import InputContainer
from av.packet import Packet
from av.stream import Discard, Stream
from av.video.stream import VideoStream

from vdet.media.backlog import Backlog
from vdet.media.demux import MAX_PIXELS, open_input, packets
from vdet.media.losses import Losses
from vdet.media.probe import check_size, period_of, picture_stream

_HIDING = ("vp8", "libvpx")  # decoders of codecs with packets that hold no picture to be shown
_MOST_EXTRA = 64  # pictures that one thread finds before the last that several have shown
_QUIET = ("vp8", "vp9")  # decoders of which some errors get lost when pictures share the threads


class Decoder:
    """The pictures of the first stream of moving pictures, in order of presentation.

    Several threads decode several pictures at once until something turns out to be damaged. Then a
    single one goes on from the last key frame before, so that what is left of the file, and what is
    counted as lost, hardly depends on the number of threads.

    Parameters
    ----------
    threads
        Of the decoder; None lets it choose.
    frame_rate
        Of numbered pictures, per second.

    Raises
    ------
    VideoError
        The file cannot be read, has no moving pictures, or its frames are too large.
    """

    def __init__(self, path: Path, *, threads: int | None, frame_rate: float) -> None:
        self._open = partial(_opened, path, frame_rate)
        self._begun_anew = False
        self._backlog = Backlog()
        self._to_skip = 0
        self._catching_up = False
        self._last: int | None = None
        self.container, self.stream = self._open(threads or 0)
        self._sources = [self.container]
        self._context = self.stream.codec_context
        # In Matroska damage shows only as a hole between packets, so that all are looked at.
        self._all = "matroska" in self.container.format.name
        for other in self.container.streams:
            if other is not self.stream and not self._all:
                other.discard = Discard.all
        paired = self._context.name not in _HIDING
        self.losses = Losses(period_of(self.stream), paired=paired)

    def pictures(self) -> Iterator[av.VideoFrame]:
        """Yield the pictures that can be decoded."""
        for packet in chain(self._packets(), [None]):
            for picture in self._decode(packet):
                if self._is_new(picture):
                    self._last = picture.pts
                    yield picture

    def close(self) -> None:
        """Let go of the file."""
        for source in self._sources:
            source.close()

    def _packets(self) -> "Iterator[Packet[Stream]]":
        held: Packet[Stream] | None = None
        streams = self.container.streams if self._all else [self.stream]
        for packet in packets(self.container, *streams, on_error=self._note_read_error):
            if self._all and packet.pos is not None:
                self.losses.pass_bytes(packet.pos, packet.size)
            if packet.stream.index == self.stream.index:
                if held is not None:
                    yield held
                held = packet
        if held is not None and held.is_corrupt:  # by the end of the file: not a whole picture
            self.losses.cut_off()
        elif held is not None:
            yield held

    def _note_read_error(self) -> None:
        self.losses.fail_to_read()

    def _decode(self, packet: "Packet[Stream] | None") -> Iterator[av.VideoFrame]:
        pictures = self._attempt(packet)
        if not self._begun_anew:
            if packet is not None:
                self._backlog.add(packet)
            if self.losses.evident or self.losses.unpaired:
                self._begun_anew = True
                if backlog := self._backlog.take():
                    yield from self._decode_again(*backlog, at_end=packet is None)
                    return
            for picture in pictures:
                self._backlog.show(picture.pts)
        yield from pictures

    def _decode_again(
        self, backlog: "list[Packet[Stream]]", shown: int, *, at_end: bool
    ) -> Iterator[av.VideoFrame]:
        """Let a single thread go on, from the backlog, of which some pictures were `shown`."""
        source, stream = self._open(1)
        self._sources.append(source)
        self._context = stream.codec_context
        self._to_skip, self._catching_up = shown, True
        self.losses = self.losses.begun_anew(self._backlog.shown)
        for packet in chain(backlog, [None] * at_end):
            yield from self._attempt(packet)

    def _attempt(self, packet: "Packet[Stream] | None") -> list[av.VideoFrame]:
        if packet is not None:
            self.losses.send(packet)
        try:
            pictures = self._context.decode(packet)
        except av.FFmpegError:
            self.losses.fail_to_decode()
            pictures = []
        useful = [picture for picture in pictures if self.losses.receive(picture)]
        if packet is None:
            self.losses.finish()
        return useful

    def _is_new(self, picture: av.VideoFrame) -> bool:
        """Tell whether a picture was not shown before the decoder began anew."""
        if self._catching_up:
            self._to_skip -= 1
            if picture.pts is not None and self._last is not None:
                self._catching_up = picture.pts <= self._last and self._to_skip > -_MOST_EXTRA
            else:
                self._catching_up = self._to_skip >= 0
            if self._catching_up:
                self.losses.repeat()
        return not self._catching_up


def _opened(path: Path, frame_rate: float, threads: int) -> tuple[InputContainer, VideoStream]:
    container = open_input(path, frame_rate)
    try:
        stream = picture_stream(container, path)
        context = stream.codec_context
        check_size(path, context.width, context.height)
    except BaseException:
        container.close()
        raise
    context.options = {"max_pixels": str(MAX_PIXELS)}
    context.thread_type = "SLICE" if context.name in _QUIET else "AUTO"
    context.thread_count = threads
    return container, stream

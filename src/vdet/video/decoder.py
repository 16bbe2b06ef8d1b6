"""Decode a picture stream from end to end, whatever is damaged in it."""

from collections.abc import Iterator

import av
from av.container import InputContainer
from av.packet import Packet
from av.stream import Discard, Stream
from av.video.stream import VideoStream

from vdet.video.demux import packets


class Decoder:
    """The pictures of one stream, in order of presentation.

    `damaged` counts the pictures lost, or decoded with errors, so far. Where the decoder works on
    several pictures at once, an error among the last few may cost the ones next to it.
    """

    def __init__(
        self, container: InputContainer, stream: VideoStream, *, threads: int | None
    ) -> None:
        self.damaged = 0
        self._container = container
        self._stream = stream
        stream.thread_type = "AUTO"
        stream.thread_count = threads or 0
        for other in container.streams:
            if other is not stream:
                other.discard = Discard.all

    def pictures(self) -> Iterator[av.VideoFrame]:
        """Yield the pictures that can be decoded."""
        held: Packet[Stream] | None = None
        for packet in packets(self._container, self._stream, on_error=self._lost):
            if held is not None:
                yield from self._decode(held)
            held = packet
        if held is not None and held.is_corrupt:
            # Cut off by the end of the file. Its error would come while the decoder is being
            # emptied, and the pictures behind it would be lost with it.
            self._lost()
        elif held is not None:
            yield from self._decode(held)
        yield from self._decode(None)

    def _decode(self, packet: "Packet[Stream] | None") -> list[av.VideoFrame]:
        try:
            pictures = self._stream.decode(packet)
        except av.FFmpegError:
            self._lost()
            return []
        self.damaged += sum(picture.is_corrupt for picture in pictures)
        return pictures

    def _lost(self) -> None:
        self.damaged += 1

"""One continuous time line for the packets of a file, where the clock of a recording restarts.

Parts of a recording that were joined byte by byte (dashcam files, the titles of a DVD) each have a
clock of their own. Each part gets an offset, the same for all streams, so that it begins where the
part before ends. FFmpeg's own program does so too (`ts_discontinuity_detect`).
"""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import islice

from av.container import InputContainer
from av.packet import Packet
from av.stream import Stream
from av.video.stream import VideoStream

from vdet.media.demux import period_of

_TS_DISCONT = 0x0200  # FFmpeg's flag of such formats: AVFMT_TS_DISCONT
_AHEAD = 256  # packets that are read ahead; one or two seconds
_BACK = Fraction(1, 10)  # seconds; a clock that goes back by more begins a part
_FORTH = 10  # seconds; a clock that goes forth by more begins a part, as in FFmpeg's own program
_FLAGGED = 2  # last packets of a part, which the demultiplexer may take for damaged


@dataclass(slots=True)
class _Part:
    """When each stream begins and ends, by its index, in seconds of the clock of the part.

    `offset` is added to the clock; it is None until it is needed.
    """

    begins: dict[int, Fraction] = field(default_factory=dict)
    ends: dict[int, Fraction] = field(default_factory=dict)
    offset: Fraction | None = None

    def goes_on(self, stream: int, begin: Fraction) -> bool:
        """Return whether the clock of a stream goes on to `begin` without a jump."""
        end = self.ends.get(stream)
        return end is None or end - _BACK <= begin <= max(self.ends.values()) + _FORTH

    def add(self, stream: int, begin: Fraction, end: Fraction) -> None:
        self.begins.setdefault(stream, begin)
        self.ends[stream] = max(self.ends.get(stream, end), end)


class ClockUnwrapper:
    """Puts packets on one time line; their order stays that of the file.

    Each stream comes to the next part where its own clock jumps: near a joint, packets of both
    parts alternate. Enough packets are read ahead that all streams of a part have begun before its
    offset is needed.

    Parameters
    ----------
    container
        Where its clock cannot restart, packets pass as they are.
    pictures
        The stream that decides where a part begins: no other comes further than the next part.

    Attributes
    ----------
    streams
        Those whose packets are needed: the pictures, and all sound where the clock may restart.
    may_restart
        Whether the clock may restart in files of this format.
    restarts
        How often it has restarted.
    """

    def __init__(self, container: InputContainer, pictures: VideoStream) -> None:
        self.restarts = 0
        self.may_restart = bool(container.format.flags & _TS_DISCONT)
        sounds = container.streams.audio if self.may_restart else ()
        self.streams: list[Stream] = [pictures, *sounds]
        self._pictures = pictures.index
        self._period = period_of(pictures)
        self._parts = [_Part(offset=Fraction(0))]  # the first keeps its clock
        self._part_of: dict[int, int] = {}  # the number of the part that each stream has come to
        self._ahead: deque[tuple[Packet[Stream], int]] = deque()  # with the number of its part

    def unwrap(self, packets: "Iterable[Packet[Stream]]") -> "Iterator[Packet[Stream]]":
        """Yield `packets`, those of `streams` and maybe of others, with continuous times."""
        if not self.may_restart:
            yield from packets
            return
        for count, packet in enumerate(packets):
            self._ahead.append((packet, self._place(packet)))
            # The first packets come at once, also from a pipe.
            if self._pictures in self._part_of and len(self._ahead) > min(count // 2, _AHEAD):
                yield self._next()
        while self._ahead:
            yield self._next()

    def _place(self, packet: "Packet[Stream]") -> int:
        """Return the number of the part of a packet, and note where it begins and ends there."""
        stream, newest = packet.stream_index, self._part_of.get(self._pictures, 0)
        number = self._part_of.setdefault(stream, newest)
        ticks = packet.pts if packet.dts is None else packet.dts
        if ticks is None:
            return number
        begin = ticks * packet.time_base
        if not self._parts[number].goes_on(stream, begin):
            # A stream follows the pictures, or comes to the part after theirs, and not further.
            number = self._part_of[stream] = newest if number < newest else newest + 1
            if number == len(self._parts):
                self._parts.append(_Part())
        duration = packet.duration or (self._period if stream == self._pictures else 0)
        self._parts[number].add(stream, begin, begin + duration * packet.time_base)
        return number

    def _next(self) -> "Packet[Stream]":
        packet, number = self._ahead.popleft()
        if packet.is_corrupt and self._ends_part(number):
            packet.is_corrupt = False  # bytes are missing after it, not in it
        ticks = round(self._offset(number) / packet.time_base)
        if packet.pts is not None:
            packet.pts += ticks
        if packet.dts is not None:
            packet.dts += ticks
        return packet

    def _offset(self, number: int) -> Fraction:
        """Return the offset of a part: no stream overlaps that of the part before."""
        part = self._parts[number]
        if part.offset is not None:
            return part.offset
        before = self._offset(number - 1)
        if self._pictures not in part.begins:  # no pictures follow the sound
            return before
        ends = self._parts[number - 1].ends
        shared = ends.keys() & part.begins.keys()
        part.offset = before + max(ends[each] - part.begins[each] for each in shared)
        self.restarts += 1
        return part.offset

    def _ends_part(self, number: int) -> bool:
        """Return whether pictures are the last ones of their part."""
        others = (place for packet, place in self._ahead if packet.stream_index == self._pictures)
        return any(place != number for place in islice(others, _FLAGGED))

"""Packets on one continuous time line, where the clock of a recording restarts.

Parts of a recording that were joined byte by byte (dashcam files, the titles of a DVD) each have a
clock of their own. Each part gets an offset, the same for all streams, so that it begins where the
part before ends. FFmpeg's own program does so too (`ts_discontinuity_detect`).
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import islice

from av.container import InputContainer
from av.packet import Packet
from av.stream import Stream
from av.video.stream import VideoStream

from vdet.media.demux import packets, period_of

_TS_DISCONT = 0x0200  # FFmpeg's flag of such formats: AVFMT_TS_DISCONT
_AHEAD = 256  # packets that are read ahead; one or two seconds
_BACK = Fraction(1, 10)  # seconds; a clock that goes back by more begins a part
_FORTH = 10  # seconds; a clock that goes forth by more begins a part, as in FFmpeg's own program
_FLAGGED = 2  # last packets of a part, which the demultiplexer may take for damaged


def restarts_clock(container: InputContainer) -> bool:
    """Return whether the clock may restart in files of this format."""
    return bool(container.format.flags & _TS_DISCONT)


def continuous_packets(
    container: InputContainer,
    main: VideoStream,
    *streams: Stream,
    on_error: Callable[[], None] = lambda: None,
    on_restart: Callable[[], None] = lambda: None,
) -> "Iterator[Packet[Stream]]":
    """Yield the packets of the pictures `main` and of other streams; skip what cannot be read.

    Where `restarts_clock`, no sound may be discarded: it is needed to find where a part begins.

    Parameters
    ----------
    on_error
        Called at each place where something had to be skipped.
    on_restart
        Called at each place where the clock restarts.
    """
    if restarts_clock(container):
        timed = {each.index: each for each in (main, *container.streams.audio, *streams)}
        found = packets(container, *timed.values(), on_error=on_error)
        yield from _Joined(main, found, on_restart)
    else:
        yield from packets(container, main, *streams, on_error=on_error)


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
        last = self.ends.get(stream)
        return last is None or last - _BACK <= begin <= max(self.ends.values()) + _FORTH

    def add(self, stream: int, begin: Fraction, end: Fraction) -> None:
        self.begins.setdefault(stream, begin)
        self.ends[stream] = max(self.ends.get(stream, end), end)


class _Joined:
    """The packets of a file, in file order, on one time line.

    Each stream goes on to the next part where its own clock jumps. Enough packets are read ahead
    that all streams of a part have begun before its offset is needed.
    """

    def __init__(
        self, main: VideoStream, found: "Iterable[Packet[Stream]]", on_restart: Callable[[], None]
    ) -> None:
        self._main = main.index
        self._period = period_of(main)
        self._found = found
        self._on_restart = on_restart
        self._ahead: deque[tuple[Packet[Stream], int]] = deque()  # with the number of the part
        self._parts = [_Part(offset=Fraction(0))]  # the first keeps its clock
        self._places: dict[int, int] = {}  # the part of each stream

    def __iter__(self) -> "Iterator[Packet[Stream]]":
        for number, packet in enumerate(self._found):
            self._ahead.append((packet, self._place(packet)))
            # The first packets come at once, also from a pipe.
            if self._main in self._places and len(self._ahead) > min(number // 2, _AHEAD):
                yield self._next()
        while self._ahead:
            yield self._next()

    def _next(self) -> "Packet[Stream]":
        packet, number = self._ahead.popleft()
        if packet.is_corrupt and self._ends_part(number):
            packet.is_corrupt = False  # bytes are missing after it, not in it
        _shift(packet, self._offset(number))
        return packet

    def _place(self, packet: "Packet[Stream]") -> int:
        """Return the number of the part of a packet, and note where it begins and ends."""
        stream, pictures = packet.stream_index, self._places.get(self._main, 0)
        number = self._places.setdefault(stream, pictures)
        ticks = packet.pts if packet.dts is None else packet.dts
        if ticks is None:
            return number
        begin = ticks * packet.time_base
        duration = packet.duration or (self._period if stream == self._main else 0)
        if not self._parts[number].goes_on(stream, begin):
            number = pictures if number < pictures else pictures + 1
            if number == len(self._parts):
                self._parts.append(_Part())
            self._places[stream] = number
        self._parts[number].add(stream, begin, begin + duration * packet.time_base)
        return number

    def _offset(self, number: int) -> Fraction:
        """Return the offset of a part: no stream overlaps that of the part before."""
        part = self._parts[number]
        if part.offset is None and self._main not in part.begins:  # no pictures follow the sound
            return self._offset(number - 1)
        if part.offset is None:
            before = self._parts[number - 1]
            shared = before.ends.keys() & part.begins.keys()
            overlap = max(before.ends[each] - part.begins[each] for each in shared)
            part.offset = self._offset(number - 1) + overlap
            self._on_restart()
        return part.offset

    def _ends_part(self, number: int) -> bool:
        """Return whether pictures are the last ones of their part."""
        others = (place for packet, place in self._ahead if packet.stream_index == self._main)
        return any(place != number for place in islice(others, _FLAGGED))


def _shift(packet: "Packet[Stream]", seconds: Fraction) -> None:
    ticks = round(seconds / packet.time_base)
    if packet.pts is not None:
        packet.pts += ticks
    if packet.dts is not None:
        packet.dts += ticks

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

from vdet.media.demux import packets
from vdet.media.probe import period_of

_TS_DISCONT = 0x0200  # FFmpeg's flag of such formats: AVFMT_TS_DISCONT
_AHEAD = 256  # packets that are read ahead; one or two seconds
_BACK = Fraction(1, 10)  # seconds; pictures whose clock goes back by more begin a part
_FORTH = 10  # seconds; a clock that goes forth by more begins a part, as in FFmpeg's own program
_NEAR = 1  # second; the sound of a part may be so far from its pictures, and may pause for so long
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
    """From where to where the clock of the pictures runs, seconds.

    `sounds` has the same for each stream of sound, by its index. `offset` is added to the clock.
    """

    begin: Fraction
    end: Fraction
    sounds: "dict[int, tuple[Fraction, Fraction]]" = field(default_factory=dict)
    offset: Fraction | None = None

    def distance(self, time: Fraction) -> Fraction:
        return max(self.begin - time, time - self.end, Fraction(0))

    def add_sound(self, stream: int, begin: Fraction, end: Fraction) -> None:
        self.sounds[stream] = (self.sounds.get(stream, (begin, end))[0], end)


@dataclass(slots=True)
class _Entry:
    """A packet with its clock, seconds, and the number of its part, once that is known."""

    packet: "Packet[Stream]"
    begin: Fraction | None
    end: Fraction
    part: int | None = None


class _Joined:
    """The packets of a file, in file order, on one time line.

    The pictures decide where a part begins. The sound comes a little earlier or later in the file.
    """

    def __init__(
        self, main: VideoStream, found: "Iterable[Packet[Stream]]", on_restart: Callable[[], None]
    ) -> None:
        self._main = main.index
        self._period = period_of(main)
        self._entries = map(self._enter, found)
        self._on_restart = on_restart
        self._ahead: deque[_Entry] = deque()
        self._parts: list[_Part] = []  # none before the first picture
        self._latest = Fraction(0)  # of the clock of any sound in the last part
        self._places: dict[int, int] = {}  # the part of each stream of sound

    def __iter__(self) -> "Iterator[Packet[Stream]]":
        for number, entry in enumerate(self._entries):
            self._ahead.append(entry)
            # The first packets come at once, also from a pipe.
            if self._parts and len(self._ahead) > min(number // 2, _AHEAD):
                yield self._next()
        while self._ahead:
            yield self._next()

    def _next(self) -> "Packet[Stream]":
        entry = self._ahead.popleft()
        part = self._part_of(entry)
        if part.offset is None:
            self._align(part)
        packet = entry.packet
        if packet.is_corrupt and self._ends_part(entry):
            packet = _without_flags(packet)
        _shift(packet, part.offset or Fraction(0))
        return packet

    def _enter(self, packet: "Packet[Stream]") -> _Entry:
        ticks = packet.pts if packet.dts is None else packet.dts
        begin = None if ticks is None else ticks * packet.time_base
        is_picture = packet.stream_index == self._main
        duration = packet.duration or (self._period if is_picture else 0)
        end = (begin or 0) + duration * packet.time_base
        if is_picture:
            self._extend(begin, end)
            return _Entry(packet, begin, end, len(self._parts) - 1)
        if not self._parts or self._latest < end <= self._reach():
            self._latest = end
        return _Entry(packet, begin, end)

    def _reach(self) -> Fraction:
        """Return the latest time that the clock of the last part may go on to."""
        return max(self._parts[-1].end, self._latest) + _FORTH

    def _extend(self, begin: Fraction | None, end: Fraction) -> None:
        """Add a picture to the last part, or begin one."""
        if not self._parts:
            self._parts.append(_Part(begin or Fraction(0), end))
        elif begin is not None:
            last = self._parts[-1]
            if last.end - _BACK <= begin <= self._reach():
                last.end = max(last.end, end)
            else:
                self._parts.append(_Part(begin, end))
                self._latest = begin

    def _part_of(self, entry: _Entry) -> _Part:
        if not self._parts:  # there are no pictures
            self._parts.append(_Part(Fraction(0), Fraction(0)))
        if entry.part is None:
            stream = entry.packet.stream_index
            entry.part = self._places.get(stream, 0)
            if entry.begin is not None:
                while self._is_later(stream, entry.begin, entry.part):
                    entry.part += 1
                self._parts[entry.part].add_sound(stream, entry.begin, entry.end)
            self._places[stream] = entry.part
        return self._parts[entry.part]

    def _is_later(self, stream: int, begin: Fraction, number: int) -> bool:
        """Return whether sound at `begin` of its clock belongs to a part after this one."""
        if number == len(self._parts) - 1:
            return False
        here, there = self._parts[number : number + 2]
        _, end = here.sounds.get(stream, (begin, begin))
        follows = end - _BACK <= begin <= end + _NEAR
        return there.distance(begin) < here.distance(begin) + (-_NEAR if follows else _NEAR)

    def _align(self, part: _Part) -> None:
        """Set the offset of a part: no stream overlaps that of the part before."""
        number = self._parts.index(part)
        if number == 0:
            part.offset = Fraction(0)  # the first keeps its clock
            return
        before = self._parts[number - 1]
        if before.offset is None:
            self._align(before)
        for entry in islice(self._ahead, _AHEAD // 2):
            self._part_of(entry)
        overlaps = [before.end - part.begin]
        for stream, (begin, _) in part.sounds.items():
            if stream in before.sounds:
                overlaps.append(before.sounds[stream][1] - begin)
        part.offset = max(overlaps) + (before.offset or 0)
        self._on_restart()

    def _ends_part(self, entry: _Entry) -> bool:
        """Return whether pictures are the last ones of their part."""
        others = (each.part for each in self._ahead if each.packet.stream_index == self._main)
        return any(part != entry.part for part in islice(others, _FLAGGED))


def _without_flags(packet: "Packet[Stream]") -> "Packet[Stream]":
    """Return a copy that is not marked as damaged: bytes are missing after it, not in it."""
    copy = type(packet)(bytes(packet))
    copy.pts, copy.dts, copy.duration = packet.pts, packet.dts, packet.duration
    copy.time_base, copy.stream = packet.time_base, packet.stream
    copy.is_keyframe = packet.is_keyframe
    return copy


def _shift(packet: "Packet[Stream]", seconds: Fraction) -> None:
    ticks = round(seconds / packet.time_base)
    if packet.pts is not None:
        packet.pts += ticks
    if packet.dts is not None:
        packet.dts += ticks

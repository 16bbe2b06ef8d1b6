"""One continuous time line for the packets of a file, where the clock of a recording restarts.

Parts of a recording that were joined byte by byte (dashcam files, the titles of a DVD) each have a
clock of their own. Each part gets an offset, the same for all streams, so that it begins where the
part before ends. FFmpeg's own program does so too (`ts_discontinuity_detect`).
"""

from collections.abc import Iterable, Iterator
from fractions import Fraction

from av.container import InputContainer
from av.packet import Packet
from av.stream import Stream
from av.video.stream import VideoStream

from vdet.media.demux import rate_of

_TS_DISCONT = 0x0200  # FFmpeg's flag of such formats: AVFMT_TS_DISCONT
_BACK = Fraction(1, 10)  # seconds; a clock that goes back by more begins a part
_FORTH = 10  # seconds; a clock that goes forth by more begins a part, as in FFmpeg's own program


class ClockUnwrapper:
    """Puts packets on one time line; their order stays that of the file.

    Each stream comes to the next part where its own clock jumps: near a joint, packets of both
    parts alternate. The first stream that comes to a part decides its offset.

    Parameters
    ----------
    container
        Where its clock cannot restart, packets pass as they are.
    pictures
        The stream whose restarts count.

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
        self._period = 1 / rate_of(pictures)
        self._offsets = [Fraction(0)]  # of each part, seconds; the first keeps its clock
        self._part_of: dict[int, int] = {}  # the number of the part that each stream has come to
        self._ends: dict[int, Fraction] = {}  # of each stream, seconds of the one time line

    def unwrap(self, packets: "Iterable[Packet[Stream]]") -> "Iterator[Packet[Stream]]":
        """Yield `packets`, those of `streams` and maybe of others, with continuous times."""
        for packet in packets:
            ticks = packet.pts if packet.dts is None else packet.dts
            if self.may_restart and ticks is not None:
                self._move(packet, ticks * packet.time_base)
            yield packet

    def _move(self, packet: "Packet[Stream]", begin: Fraction) -> None:
        """Add the offset of its part to the times of a packet, and note where it ends."""
        stream = packet.stream_index
        number = self._part_at(stream, begin)
        self.restarts += stream == self._pictures and number > self._part_of[stream]
        self._part_of[stream] = number
        duration = (packet.duration or 0) * packet.time_base or self._period
        end = begin + self._offsets[number] + duration
        self._ends[stream] = max(self._ends.get(stream, end), end)
        shift = round(self._offsets[number] / packet.time_base)
        packet.pts = None if packet.pts is None else packet.pts + shift
        packet.dts = None if packet.dts is None else packet.dts + shift

    def _part_at(self, stream: int, begin: Fraction) -> int:
        """Return the part in which a stream goes on at a time of its clock; it may be a new one."""
        newest = self._part_of.get(self._pictures, 0)
        for number in range(self._part_of.setdefault(stream, newest), len(self._offsets)):
            if self._goes_on(stream, begin + self._offsets[number]):
                return number
        self._offsets.append(max(self._ends.values()) - begin)
        return len(self._offsets) - 1

    def _goes_on(self, stream: int, begin: Fraction) -> bool:
        end = self._ends.get(stream)
        return end is None or end - _BACK <= begin <= max(self._ends.values()) + _FORTH

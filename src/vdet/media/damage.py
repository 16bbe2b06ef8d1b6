"""How many pictures of a stream are lost, or decoded with errors."""

from dataclasses import dataclass
from fractions import Fraction

import av
from av.packet import Packet
from av.stream import Stream

_HOLE = 256  # bytes; what lies between two packets of a whole Matroska file is far less
_MAX_LATE = 32  # periods; a picture later than that follows a clock that was set back
_REGULAR = Fraction(4, 5)  # share of the steps that must be one period


@dataclass(slots=True)
class Damage:
    """Counts the errors, and the corrupt and missing pictures, of one stream.

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
    errors
        Places in the file that cannot be read, and packets that cannot be decoded.
    has_hole
        Whether bytes between two packets belong to none. This may be damage, or data of another
        kind, such as transparency: whether pictures were lost shows in their times.
    lost_at_end
        Pictures after the last one that can be read.
    """

    period: Fraction
    paired: bool
    errors: int = 0
    has_hole: bool = False
    packets: int = 0
    corrupt_packets: int = 0
    pictures: int = 0
    corrupt_pictures: int = 0
    lost_at_end: int = 0
    _without_picture: int = 0  # packets
    _skipped: int = 0  # pictures, by their times
    _last: int | None = None  # time of a picture
    _steps: int = 0
    _regular_steps: int = 0
    _read_to: int | None = None  # byte of the file
    _largest: int = _HOLE  # packet, bytes

    @property
    def is_evident(self) -> bool:
        """Whether there is evidence of damage."""
        return self.has_hole or self.errors + self.corrupt_packets + self.corrupt_pictures > 0

    @property
    def lost(self) -> int:
        """Pictures that should be there and are not."""
        is_regular = self._regular_steps >= _REGULAR * self._steps
        skipped = self._skipped if is_regular else 0
        missing = max(self.errors, self._without_picture, skipped) if self.is_evident else 0
        return missing + self.lost_at_end

    @property
    def damaged(self) -> int:
        """Pictures lost, and pictures decoded with errors."""
        return max(self.lost + self.corrupt_pictures, self.corrupt_packets)

    @property
    def total(self) -> int:
        """Pictures that came, and those lost."""
        return self.pictures + self.lost

    def fail(self) -> None:
        """Count an error."""
        self.errors += 1

    def pass_bytes(self, position: int, size: int) -> None:
        """Note where in the file a packet of any stream lies."""
        if self._read_to is not None:
            self.has_hole |= position - self._read_to > _HOLE
        self._read_to = max(self._read_to or 0, position + size)
        self._largest = max(self._largest, size)

    def goes_on(self, file_size: int) -> bool:
        """Return whether the file goes on, unreadable, after the last packet.

        A file that was cut off ends within a packet.
        """
        return self._read_to is not None and file_size - self._read_to > 2 * self._largest

    def send(self, packet: "Packet[Stream]") -> None:
        """Count a packet of the stream."""
        self.packets += not packet.is_discard  # else the file says that it is not shown
        self.corrupt_packets += packet.is_corrupt

    def receive(self, picture: av.VideoFrame) -> bool:
        """Count a picture; return whether it is usable.

        One that comes late, where there is damage, is not usable: it counts as lost.
        """
        time, last = picture.pts, self._last
        step = None if time is None or last is None else time - last
        is_late = step is not None and -_MAX_LATE * self.period <= step <= 0
        if is_late and self.is_evident:
            return False
        self.pictures += 1
        self.corrupt_pictures += picture.is_corrupt
        self.paired &= not picture.interlaced_frame  # each of two fields may have a packet
        if step is not None:
            self._steps += 1
            self._regular_steps += abs(step - self.period) <= max(Fraction(1), self.period / 20)
            if self.is_evident:
                self._skipped += max(0, round(step / self.period) - 1)
        if time is not None and not is_late:
            self._last = time
        return True

    def finish(self) -> None:
        """Note that no more pictures will come."""
        if self.paired:
            self._without_picture = self.packets - self.pictures

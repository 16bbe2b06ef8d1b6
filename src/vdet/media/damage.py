"""Count the pictures of a stream that are lost or damaged, by what goes in and what comes out."""

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
    """Counts the pictures of one stream that are lost, or decoded with errors.

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
    """

    period: Fraction
    paired: bool
    evident: bool = False
    packets: int = 0
    corrupt_packets: int = 0
    pictures: int = 0
    corrupt_pictures: int = 0
    read_errors: int = 0
    decode_errors: int = 0
    without_picture: int = 0  # packets
    lost_at_end: int = 0
    _last: int | None = None  # time of a picture
    _steps: int = 0
    _regular_steps: int = 0
    _skipped: int = 0
    _skipped_in_damage: int = 0
    _read_to: int | None = None  # byte of the file

    @property
    def lost(self) -> int:
        """Pictures that should be there and are not."""
        if not self.evident:
            return self.lost_at_end
        errors = self.read_errors + self.decode_errors
        skipped = self._if_regular(self._skipped_in_damage)
        return max(errors, self.without_picture, skipped) + self.lost_at_end

    @property
    def damaged(self) -> int:
        """Pictures lost, and pictures decoded with errors."""
        return max(self.lost + self.corrupt_pictures, self.corrupt_packets)

    @property
    def total(self) -> int:
        """Pictures that came, and those lost."""
        return self.pictures + self.lost

    @property
    def skipped(self) -> int:
        """Pictures missing between the times of others, where most times are regular."""
        return self._if_regular(self._skipped)

    def fail_to_read(self) -> None:
        """Count a place in the file that cannot be read."""
        self.read_errors += 1
        self.evident = True

    def pass_bytes(self, position: int, size: int) -> None:
        """Note where in the file a packet of any stream lies; a hole between two is damage."""
        if self._read_to is not None and position - self._read_to > _HOLE:
            self.fail_to_read()
        self._read_to = max(self._read_to or 0, position + size)

    def send(self, packet: "Packet[Stream]") -> None:
        """Count a packet of the stream."""
        self.packets += not packet.is_discard  # else the file says that it is not shown
        self.corrupt_packets += packet.is_corrupt
        self.evident |= packet.is_corrupt

    def fail_to_decode(self) -> None:
        """Count a packet that cannot be decoded."""
        self.decode_errors += 1
        self.evident = True

    def receive(self, picture: av.VideoFrame) -> bool:
        """Count a picture; return whether it is usable.

        One that comes late, where there is damage, is not usable: it counts as lost.
        """
        if self.evident and self._is_late(picture.pts):
            return False
        self.pictures += 1
        self.corrupt_pictures += picture.is_corrupt
        self.evident |= picture.is_corrupt
        self.paired &= not picture.interlaced_frame  # each of two fields may have a packet
        if picture.pts is not None:
            self._step_to(picture.pts)
        return True

    def finish(self) -> None:
        """Note that no more pictures will come."""
        if self.paired:
            self.without_picture = self.packets - self.pictures

    def end(self, missing: int, file_size: int) -> bool:
        """Count `missing` pictures as lost if the file goes on, unreadable, after the last packet.

        Return whether it does.
        """
        if self._read_to is None or file_size - self._read_to <= _HOLE:
            return False
        self.lost_at_end = max(self.lost_at_end, missing)
        return True

    def _is_late(self, time: int | None) -> bool:
        if time is None or self._last is None:
            return False
        return time <= self._last <= time + _MAX_LATE * self.period

    def _step_to(self, time: int) -> None:
        if self._last is None:
            self._last = time
            return
        step = time - self._last
        self._steps += 1
        self._regular_steps += abs(step - self.period) <= max(Fraction(1), self.period / 20)
        if self._is_late(time):  # it was taken for missing
            self._skipped = max(0, self._skipped - 1)
            return
        self._last = time
        missing = max(0, round(step / self.period) - 1)
        self._skipped += missing
        self._skipped_in_damage += missing * self.evident

    def _if_regular(self, pictures: int) -> int:
        return pictures if self._regular_steps >= _REGULAR * self._steps else 0

"""How many pictures of a stream were lost or damaged, from what went in and what came out."""

from fractions import Fraction

import av
from av.packet import Packet
from av.stream import Stream

_HOLE = 256  # bytes; what lies between two packets of a whole Matroska file is far less
_LATEST = 250  # periods by which a picture is late; by more, the clock was set back
_REGULAR = Fraction(4, 5)  # share of the steps from which on they are one period


class Losses:
    """Counts the pictures of one stream that were lost, or decoded with errors.

    Nothing is counted before there is evidence of damage: what a whole file leaves out (frames
    that a camera dropped, packets that hold no picture) is not lost. From there on that many are
    lost as packets gave none, or as the times jump over.

    Parameters
    ----------
    period
        Time from one picture to the next, units of the stream's time base.
    paired
        Whether every packet makes one picture.
    """

    def __init__(self, period: Fraction, *, paired: bool) -> None:
        self.evident = False
        self._period = period
        self._paired = paired
        self._sent = self._corrupt_packets = 0
        self._pictures = self._corrupt = self._before = 0
        self._read_errors = self._decoding_errors = 0
        self._steps = self._regular = self._jumps = self._jumps_amid_damage = 0
        self._beyond = 0
        self._last: int | None = None  # time of the last picture, and of the last packet
        self._newest: int | None = None
        self._reached: int | None = None  # byte of the file
        self._finished = False

    def begun_anew(self, shown: int) -> "Losses":
        """Return what to count with from an earlier key frame on, when so many were `shown`."""
        losses = Losses(self._period, paired=self._paired)
        losses._before = shown
        losses._read_errors = self._read_errors
        losses._reached = self._reached
        losses._beyond = self._beyond
        losses.evident = self._read_errors > 0
        return losses

    @property
    def lost(self) -> int:
        """Pictures that there should be, and are not."""
        if not self.evident:
            return self._beyond
        errors = self._read_errors + self._decoding_errors
        return max(errors, self.unpaired, self._if_regular(self._jumps_amid_damage)) + self._beyond

    @property
    def damaged(self) -> int:
        """Pictures lost, and pictures shown with errors."""
        return max(self.lost + self._corrupt, self._corrupt_packets)

    @property
    def total(self) -> int:
        """Pictures that came, and those that should have."""
        return self._before + self._pictures + self.lost

    @property
    def unpaired(self) -> int:
        """Packets that have given no picture, once the decoder is empty."""
        return max(0, self._sent - self._pictures) if self._finished and self._paired else 0

    @property
    def jumped(self) -> int:
        """Pictures for which there was time between others, where times are mostly regular."""
        return self._if_regular(self._jumps)

    def send(self, packet: "Packet[Stream]") -> None:
        """Count a packet of the stream."""
        self._sent += not packet.is_discard  # cut away by the file itself
        if packet.pts is not None:
            self._newest = max(packet.pts, packet.pts if self._newest is None else self._newest)
        self._corrupt_packets += packet.is_corrupt
        self.evident |= packet.is_corrupt

    def fail_to_read(self) -> None:
        """Count an error of reading, whatever it cost."""
        self._read_errors += 1
        self.evident = True

    def fail_to_decode(self) -> None:
        """Count a packet that cannot be decoded."""
        self._decoding_errors += 1
        self.evident = True

    def receive(self, picture: av.VideoFrame) -> bool:
        """Count a picture that was decoded; return whether it is of use.

        Of no use is one that comes late because others around it are damaged: it counts as lost.
        """
        if self.evident and self._is_late(picture.pts):
            return False
        self._pictures += 1
        self._corrupt += picture.is_corrupt
        self.evident |= picture.is_corrupt
        if picture.interlaced_frame:  # each half of it may have a packet
            self._paired = False
        if picture.pts is not None:
            self._step_to(picture.pts)
        return True

    def repeat(self) -> None:
        """Take note that the picture received last was shown before."""
        self._before -= 1

    def cut_off(self) -> None:
        """Count the last packet, of which the file has only a part."""
        self._beyond = 1

    def finish(self) -> None:
        """Take note that the decoder has given all that it had."""
        self._finished = True
        if self._newest is not None:
            self._step_to(self._newest + round(self._period))

    def pass_bytes(self, position: int, size: int) -> None:
        """Note where in the file a packet lies, of whichever stream: a hole between is damage."""
        if self._reached is not None and position - self._reached > _HOLE:
            self.fail_to_read()
        self._reached = max(self._reached or 0, position + size)

    def end(self, missing: int, file_size: int) -> bool:
        """Count the pictures that miss at the end as lost if the file goes on there, unreadable."""
        if self._reached is None or file_size - self._reached <= _HOLE:
            return False
        self._beyond = max(self._beyond, missing)
        return True

    def _is_late(self, time: int | None) -> bool:
        """Tell a picture out of order from one after a clock that was set back."""
        if time is None or self._last is None:
            return False
        return time <= self._last <= time + _LATEST * self._period

    def _step_to(self, time: int) -> None:
        if self._last is None:
            self._last = time
            return
        step = time - self._last
        self._last = max(self._last, time) if self._is_late(time) else time
        self._steps += 1
        if abs(step - self._period) <= max(Fraction(1), self._period / 20):
            self._regular += 1
            return
        missing = 0
        if step > self._period * 3 / 2:
            missing = round(step / self._period) - 1
        elif step <= 0 and self._jumps:  # comes late, and was taken for missing
            missing = -1
        self._jumps += missing
        if self.evident:
            self._jumps_amid_damage += missing

    def _if_regular(self, jumps: int) -> int:
        return jumps if self._regular >= _REGULAR * self._steps else 0

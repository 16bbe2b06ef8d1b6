"""The last packets of a stream, from which a decoder can begin anew."""

from collections import deque
from dataclasses import dataclass, field
from itertools import dropwhile

from av.packet import Packet
from av.stream import Stream

_MOST_PACKETS = 1000
_MOST_BYTES = 64_000_000


@dataclass(slots=True)
class _Group:
    """A key packet and those that depend on it; `index` counts the packets before it."""

    index: int
    packets: "list[Packet[Stream]]" = field(default_factory=list)

    @property
    def start(self) -> int | None:
        return self.packets[0].pts


class Backlog:
    """Keeps packets back to the last key frame that was shown, as long as they are not too many.

    A decoder that is given these packets comes to where another one is, whatever that one still
    holds back. Give it each packet as it is decoded, and each picture as it is shown.
    """

    def __init__(self) -> None:
        self._groups: deque[_Group] = deque()
        self.shown = 0  # pictures
        self._packets = self._bytes = self._index = 0
        self._usable = True  # at the start of the file nothing has to be shown first

    def add(self, packet: "Packet[Stream]") -> None:
        """Keep the next packet."""
        if packet.is_keyframe or self._index == 0:
            self._groups.append(_Group(self._index))
        self._index += 1
        if not self._groups:
            return
        self._groups[-1].packets.append(packet)
        self._packets += 1
        self._bytes += packet.size
        if self._packets > _MOST_PACKETS or self._bytes > _MOST_BYTES:
            self._groups.clear()
            self._packets = self._bytes = 0
            self._usable = False

    def show(self, pts: int | None) -> None:
        """Forget what lies before the last key frame that is shown no later than this picture."""
        self.shown += 1
        while len(self._groups) > 1 and self._is_shown(self._groups[1], pts):
            gone = self._groups.popleft()
            self._packets -= len(gone.packets)
            self._bytes -= sum(packet.size for packet in gone.packets)
        if not self._usable and self._groups and self._is_shown(self._groups[0], pts):
            self._usable = True

    def take(self) -> "tuple[list[Packet[Stream]], int] | None":
        """Return the packets, and how many pictures of theirs were shown; None where they miss.

        The number is right where every packet makes one picture. Left out are packets right after
        the first that are shown before it: they depend on what is not there. (At the start of the
        file there is nothing else.)
        """
        if not self._usable or not self._groups:
            return None
        key, *others = (packet for group in self._groups for packet in group.packets)
        index = self._groups[0].index
        following = dropwhile(lambda packet: index > 0 and _is_before(packet, key), others)
        return [key, *following], self.shown - index

    def _is_shown(self, group: _Group, pts: int | None) -> bool:
        if pts is None or group.start is None:
            return group.index < self.shown
        return group.start <= pts


def _is_before(packet: "Packet[Stream]", key: "Packet[Stream]") -> bool:
    return packet.pts is not None and key.pts is not None and packet.pts < key.pts

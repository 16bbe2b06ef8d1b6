"""Whether the sound of a file, as it is, can go into another kind of file: tried out in memory."""

import io
from collections import Counter
from itertools import islice
from pathlib import Path

import av
from av.packet import Packet
from av.stream import Discard, Stream

from vdet.media.demux import open_input, packets

_TRIES = 20  # packets of one stream; the first ones may be damaged
_LOOK_AHEAD = 100_000  # packets; a stream that begins later than half an hour is not waited for


def try_sounds(path: Path, kind: str) -> dict[int, bool]:
    """Tell which sound streams of `path` a file of the format `kind` can hold.

    A codec that the format does not know, and parameters that are damaged, show only when such a
    file is written, where they would cost the picture, too.

    Returns
    -------
    For each stream, by its index, whether it can be held; without those that have no packets.

    Raises
    ------
    VideoError
        The file cannot be opened.
    """
    found: dict[int, bool] = {}
    tries: Counter[int] = Counter()
    with open_input(path) as source:
        sounds = source.streams.audio
        for stream in source.streams:
            if stream not in sounds:
                stream.discard = Discard.all
        for packet in islice(packets(source, *sounds, on_error=_go_on), _LOOK_AHEAD):
            index = packet.stream.index
            if not found.get(index) and tries[index] < _TRIES:
                tries[index] += 1
                found[index] = _can_hold(kind, packet)
            if len(found) == len(sounds) and all(
                held or tries[index] == _TRIES for index, held in found.items()
            ):
                break
    return found


def _can_hold(kind: str, packet: "Packet[Stream]") -> bool:
    try:
        with av.open(io.BytesIO(), "w", kind) as trial:
            copy = trial.add_stream_from_template(packet.stream)
            packet.stream = copy
            packet.pts = packet.dts = 0
            trial.mux(packet)
    except (ValueError, av.FFmpegError):
        return False
    return True


def _go_on() -> None:
    """Take no notice of what cannot be read; whoever copies the sound will tell of it."""

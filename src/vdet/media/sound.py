"""Copy the sound of one video file into another, as it is."""

import io
import logging
from collections import Counter
from collections.abc import Generator
from fractions import Fraction
from itertools import islice
from pathlib import Path

import av
from av.audio.stream import AudioStream
from av.container import OutputContainer
from av.packet import Packet
from av.stream import Discard, Stream

from vdet.media.demux import open_input, packets
from vdet.media.probe import picture_stream
from vdet.media.restarts import continuous_packets, restarts_clock

_log = logging.getLogger("vdet")

_MAX_TRIALS = 20  # packets of one stream; the first ones may be damaged
_MAX_PACKETS = 100_000  # read in search of sound; about half an hour of it


class SoundCopy:
    """Copies the packets of every sound stream of `source` to `target`, bit for bit.

    Times stay relative to the picture: second `origin` of the source becomes second 0 of the
    target. What begins earlier is left out, except one packet where the target can hide it (mp4 and
    mov): a decoder needs it to start from. Damaged packets, and a stream that the target cannot
    hold, are left out with a warning (logger "vdet"). Make the copy before anything is written to
    `target`.

    Raises
    ------
    VideoError
        `source` cannot be opened.
    """

    def __init__(self, source: Path, target: OutputContainer, origin: Fraction) -> None:
        self._path = source
        self._target = target
        self._damaged = self._untimed = 0
        self._origin = origin
        self._source = open_input(source)
        try:
            self._pictures = picture_stream(self._source, source)
            self._streams = self._add_streams()
        except BaseException:
            self._source.close()
            raise
        self._packets = self._moved()
        self._next = next(self._packets, None)

    def copy(self, until: Fraction | None) -> None:
        """Copy what begins before second `until` of the target; for None, all that is left."""
        while self._next is not None and (until is None or _begin(self._next) < until):
            try:
                self._target.mux(self._next)
            except av.InvalidDataError:  # found while it is repacked for another container
                self._damaged += 1
            self._next = next(self._packets, None)

    def close(self) -> None:
        """Close the source; warn of packets that could not be copied."""
        if self._damaged:
            _log.warning("%s: %d damaged sound packets left out", self._path, self._damaged)
        if self._untimed:
            _log.warning(
                "%s: %d sound packets without a time of their own left out",
                self._path,
                self._untimed,
            )
        self._packets.close()
        self._source.close()

    def _add_streams(self) -> dict[int, AudioStream]:
        """Add streams to the target; return them by their index in the source."""
        streams = {}
        kind = self._target.format.name
        held = held_sounds(self._path, kind)
        for stream in self._source.streams:
            if not isinstance(stream, AudioStream):
                if stream.index != self._pictures.index or not restarts_clock(self._source):
                    stream.discard = Discard.all
                continue
            if not held.get(stream.index):
                codec = stream.codec_context.name if stream.codec_context else "of unknown codec"
                fault = f"cannot go into {kind}" if stream.index in held else "is empty"
                _log.warning("%s: its sound (%s) %s; left out", self._path, codec, fault)
                continue
            streams[stream.index] = self._target.add_stream_from_template(stream)
            if stream.language:
                streams[stream.index].metadata["language"] = stream.language
        return streams

    def _moved(self) -> "Generator[Packet[Stream], None, None]":
        """Yield the packets to copy, with their times and their stream in the target."""
        if not self._streams:
            return
        wanted = [stream for stream in self._source.streams if stream.index in self._streams]
        last: dict[int, int] = {}
        for packet in continuous_packets(self._source, self._pictures, *wanted):
            index = packet.stream.index
            if index not in self._streams:
                continue
            if (
                packet.pts is None
                or packet.dts is None
                or packet.dts <= last.get(index, packet.dts - 1)
            ):
                self._untimed += 1  # muxers refuse times that do not increase
                continue
            last[index] = packet.dts
            shift = round(self._origin / packet.time_base)
            packet.pts -= shift
            packet.dts -= shift
            if self._is_early(packet):
                continue
            packet.stream = self._streams[index]
            yield packet

    def _is_early(self, packet: "Packet[Stream]") -> bool:
        begin = _begin(packet)
        if self._target.format.name == "matroska":
            return begin < 0
        return begin + (packet.duration or 0) * packet.time_base < 0


def _begin(packet: "Packet[Stream]") -> Fraction:
    return (packet.pts or 0) * packet.time_base


def held_sounds(path: Path, kind: str) -> dict[int, bool]:
    """Return whether a file of the format `kind` can hold each sound stream of `path`, by index.

    Streams without packets are left out. It is tried in memory: an unknown codec and damaged
    parameters show only when a file is written, and there they would cost the picture too.
    """
    found: dict[int, bool] = {}
    trials: Counter[int] = Counter()
    with open_input(path) as source:
        sounds = source.streams.audio
        for stream in source.streams:
            if stream not in sounds:
                stream.discard = Discard.all
        for packet in islice(packets(source, *sounds, on_error=lambda: None), _MAX_PACKETS):
            index = packet.stream.index
            if not found.get(index) and trials[index] < _MAX_TRIALS:
                trials[index] += 1
                found[index] = _can_hold(kind, packet)
            if len(found) == len(sounds) and all(
                held or trials[index] == _MAX_TRIALS for index, held in found.items()
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

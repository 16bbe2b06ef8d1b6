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
        self._left_out = 0  # packets
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
                self._left_out += 1
            self._next = next(self._packets, None)

    def close(self) -> None:
        """Close the source; warn of packets that could not be copied."""
        if self._left_out:
            fault = "damaged, or without a time of their own"
            _log.warning("%s: %d sound packets left out: %s", self._path, self._left_out, fault)
        self._packets.close()
        self._source.close()

    def _add_streams(self) -> dict[int, AudioStream]:
        """Add streams to the target; return them by their index in the source."""
        kind = self._target.format.name
        held = held_sounds(self._path, kind)
        streams = {}
        for stream in self._source.streams:
            if not isinstance(stream, AudioStream):
                if stream.index != self._pictures.index or not restarts_clock(self._source):
                    stream.discard = Discard.all
            elif stream.index in held:
                streams[stream.index] = self._target.add_stream_from_template(stream)
                if stream.language:
                    streams[stream.index].metadata["language"] = stream.language
            else:
                codec = stream.codec_context.name if stream.codec_context else "unknown codec"
                fault = f"its sound ({codec}) is empty, or cannot go into {kind}; left out"
                _log.warning("%s: %s", self._path, fault)
        return streams

    def _moved(self) -> "Generator[Packet[Stream], None, None]":
        """Yield the packets to copy, with their times and their stream in the target."""
        if not self._streams:
            return
        wanted = [stream for stream in self._source.streams if stream.index in self._streams]
        last: dict[int, int] = {}
        for packet in continuous_packets(self._source, self._pictures, *wanted):
            index, pts, dts = packet.stream.index, packet.pts, packet.dts
            if index not in self._streams:
                continue
            if pts is None or dts is None or dts <= last.get(index, dts - 1):
                self._left_out += 1  # muxers refuse times that do not increase
                continue
            last[index] = dts
            shift = round(self._origin / packet.time_base)
            packet.pts, packet.dts = pts - shift, dts - shift
            if not self._is_early(packet):
                packet.stream = self._streams[index]
                yield packet

    def _is_early(self, packet: "Packet[Stream]") -> bool:
        begin = _begin(packet)
        if self._target.format.name == "matroska":
            return begin < 0
        return begin + (packet.duration or 0) * packet.time_base < 0


def _begin(packet: "Packet[Stream]") -> Fraction:
    return (packet.pts or 0) * packet.time_base


def held_sounds(path: Path, kind: str) -> set[int]:
    """Return the indices of the sound streams of `path` that a file of the format `kind` can hold.

    It is tried in memory: an unknown codec and damaged parameters show only when a file is written,
    and there they would cost the picture too.
    """
    held: set[int] = set()
    trials: Counter[int] = Counter()
    with open_input(path) as source:
        sounds = source.streams.audio
        for stream in source.streams:
            if stream not in sounds:
                stream.discard = Discard.all
        for packet in islice(packets(source, *sounds, on_error=lambda: None), _MAX_PACKETS):
            index = packet.stream.index
            trials[index] += 1
            if index not in held and trials[index] <= _MAX_TRIALS and _can_hold(kind, packet):
                held.add(index)
            if all(each.index in held or trials[each.index] >= _MAX_TRIALS for each in sounds):
                break
    return held


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

"""Carry the sound of one video file over into another, as it is."""

import logging
from collections.abc import Generator
from fractions import Fraction
from pathlib import Path

import av
from av.audio.stream import AudioStream
from av.container import OutputContainer
from av.packet import Packet
from av.stream import Discard, Stream

from vdet.media.demux import open_input, packets
from vdet.media.sound_trial import try_sounds

_log = logging.getLogger("vdet")


class SoundCopy:
    """Copies the packets of every sound stream of `source` to `target`, bit for bit.

    Times are kept relative to the picture: second `origin` of the source becomes second 0 of the
    target. What begins earlier is left out, but for one packet where the target can hide it (mp4
    and mov): a decoder needs it to start from. Damaged packets, and a stream that the target cannot
    hold, are left out with a warning (logger "vdet"). To be made before anything is written to
    `target`.

    Raises
    ------
    VideoError
        `source` cannot be opened.
    """

    def __init__(self, source: Path, target: OutputContainer, origin: Fraction) -> None:
        self._path = source
        self._target = target
        self._damaged = 0
        self._origin = origin
        self._source = open_input(source)
        try:
            self._streams = self._add_streams()
        except BaseException:
            self._source.close()
            raise
        self._packets = self._moved()
        self._next = next(self._packets, None)

    def copy(self, until: Fraction | None) -> None:
        """Copy what begins before second `until` of the target; None: all that is left."""
        while self._next is not None and (until is None or _begin(self._next) < until):
            try:
                self._target.mux(self._next)
            except av.InvalidDataError:  # found when it was to be repacked for another container
                self._damaged += 1
            self._next = next(self._packets, None)

    def close(self) -> None:
        """Let go of the source; warn of what could not be copied."""
        if self._damaged:
            _log.warning("%s: %d damaged sound packets left out", self._path, self._damaged)
        self._packets.close()
        self._source.close()

    def _add_streams(self) -> dict[int, AudioStream]:
        """Make the streams of the target; the keys are the indices of the same in the source."""
        streams = {}
        kind = self._target.format.name
        held = try_sounds(self._path, kind)
        for stream in self._source.streams:
            if not isinstance(stream, AudioStream):
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
        """Yield the packets to copy, with the times and the stream they have in the target."""
        if not self._streams:
            return
        wanted = [stream for stream in self._source.streams if stream.index in self._streams]
        last: dict[int, int] = {}
        for packet in packets(self._source, *wanted, on_error=lambda: None):
            index = packet.stream.index
            if (
                packet.pts is None
                or packet.dts is None
                or packet.dts <= last.get(index, packet.dts - 1)
            ):
                continue  # muxers refuse times that do not increase
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

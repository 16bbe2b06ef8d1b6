"""Cut parts out of a video: copy whole key-frame intervals, or encode exact frames."""

import math
from collections.abc import Iterable, Iterator
from contextlib import closing
from fractions import Fraction
from pathlib import Path

import av
from av.packet import Packet
from av.stream import Stream

from vdet.config.schema import Settings
from vdet.errors import OutputError
from vdet.media.demux import Demuxer
from vdet.media.images import is_image_name
from vdet.media.reader import VideoReader
from vdet.media.writer import MARK, VIDEO_SUFFIXES, VideoWriter

_AUDIO_LAG = 1  # seconds of video after the end in which audio of the part may still follow


def can_copy(source: Path) -> bool:
    """Return whether parts of a video can be copied: it is seekable, and has one clock."""
    if not source.is_file() or is_image_name(source):
        return False
    with closing(Demuxer(source)) as demuxer:
        return not demuxer.may_restart


def copied_suffix(source: Path) -> str:
    """Return the suffix of copied parts: that of the source, or .mkv, which supports any codec."""
    suffix = source.suffix.lower()
    return suffix if suffix in VIDEO_SUFFIXES else ".mkv"


def copy_part(source: Path, start: Fraction, end: Fraction, target: Path) -> None:
    """Copy the key-frame intervals that contain a part of a video, with its audio.

    Parameters
    ----------
    start, end
        Times as in `Frame.time`, seconds. The copy begins at the last key frame at or before
        `start`, and ends before the first one at or after `end`.

    Raises
    ------
    VideoError
        The source cannot be read.
    OutputError
        The container of `target` cannot hold a stream of the source.
    """
    with closing(Demuxer(source)) as demuxer, av.open(str(target.absolute()), "w") as written:
        written.metadata["comment"] = MARK
        streams: list[Stream] = [demuxer.video, *demuxer.container.streams.audio]
        try:
            targets = {item.index: written.add_stream_from_template(item) for item in streams}
            demuxer.container.seek(int(start * av.time_base))
            for packet in _moved_to_zero(demuxer.packets(streams), demuxer.video, end):
                packet.stream = targets[packet.stream_index]
                written.mux(packet)
        except (ValueError, av.FFmpegError) as error:
            raise OutputError(f"{target.name}: cannot be copied from {source}: {error}") from error


def _moved_to_zero(
    packets: "Iterable[Packet[Stream]]", video: Stream, end: Fraction
) -> "Iterator[Packet[Stream]]":
    """Yield the packets from the first key frame of `video` to the first one at or after `end`.

    The first key frame is moved to second 0.
    """
    begin: Fraction | float = math.inf
    stop: Fraction | float = math.inf
    for packet in packets:
        if packet.pts is None or packet.dts is None:
            continue
        time, is_video = packet.pts * packet.time_base, packet.stream_index == video.index
        if is_video and packet.is_keyframe:
            begin, stop = min(begin, time), min(stop, time if time >= end else math.inf)
        if is_video and time > stop + _AUDIO_LAG:
            return
        if begin <= time < stop and not (is_video and stop < math.inf):
            shift = round(begin / packet.time_base)
            packet.pts, packet.dts = packet.pts - shift, packet.dts - shift
            yield packet


def encode_part(
    source: Path, start: Fraction, end: Fraction, target: Path, settings: Settings
) -> None:
    """Encode a part of a video, exact to the frame, with its audio.

    Parameters
    ----------
    start, end
        Seconds from the first frame; frames with start ≤ time < end are written.

    Errors as for `VideoReader` and `VideoWriter`.
    """
    with (
        VideoReader(source, start=start, end=end, settings=settings.input) as reader,
        VideoWriter(target, reader.info, settings.output, whole_audio=False) as writer,
    ):
        for frame in reader:
            writer.write(frame)

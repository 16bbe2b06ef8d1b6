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
from vdet.media.demux import Decoder, Demuxer
from vdet.media.images import is_image_name
from vdet.media.reader import VideoReader
from vdet.media.writer import MARK, VIDEO_SUFFIXES, VideoWriter

_AUDIO_LAG = 1  # seconds of video after the end in which audio of the part may still follow
_MOST_REORDERED = 17  # frames in H.264 and H.265, and one


def copied_suffix(source: Path) -> str | None:
    """Return the suffix of copied parts of a video; None if they must be encoded.

    It is that of the source, or .mkv. Copies need a file with times of its own, one clock, and key
    frames that are shown.
    """
    if not source.is_file() or is_image_name(source):
        return None
    decoder = Decoder(source, None)
    with closing(decoder.demuxer) as demuxer:
        if demuxer.may_restart or demuxer.is_raw or decoder.lacks_shown_times:
            return None
        if not decoder.shows_key_frame():
            return None
    suffix = source.suffix.lower()
    return suffix if suffix in VIDEO_SUFFIXES else ".mkv"


def copy_part(source: Path, start: Fraction, end: Fraction, target: Path) -> None:
    """Copy the key-frame intervals that contain a part of a video, with its audio.

    Parameters
    ----------
    start, end
        Times in the file, seconds. The copy begins at the last key frame at or before
        `start`, and ends before the first one at or after `end`, or with it if frames before it
        need it.

    Raises
    ------
    VideoError
        The source cannot be read.
    OutputError
        The container of `target` cannot hold a stream of the source, or an edit list hides the
        first frames of the copy.
    """
    with closing(Demuxer(source)) as demuxer, av.open(str(target.absolute()), "w") as written:
        written.metadata["comment"] = MARK
        try:
            streams: list[Stream] = [demuxer.video, *demuxer.container.streams.audio]
            targets = {
                stream.index: written.add_stream_from_template(stream, opaque=True)
                for stream in streams
            }
            # Not before the start of the file.
            demuxer.container.seek(
                max(int(start * av.time_base), demuxer.container.start_time or 0)
            )
            for packet in _moved_to_zero(demuxer.packets(streams), demuxer.video, end):
                packet.stream = targets[packet.stream_index]
                written.mux(packet)
        except (ValueError, av.FFmpegError) as error:
            raise OutputError(f"{target.name}: cannot be copied from {source}: {error}") from error


def _moved_to_zero(
    packets: "Iterable[Packet[Stream]]", video: Stream, end: Fraction
) -> "Iterator[Packet[Stream]]":
    """Yield the packets from the first key frame of `video` to the first one at or after `end`.

    The first key frame is moved to second 0. A key frame at the end is only yielded if earlier
    frames follow it (an open group).
    """
    begin: Fraction | float = math.inf
    stop: Fraction | float = math.inf
    held: list[Packet[Stream]] = []
    last: dict[int, int] = {}  # decoding times, by stream
    for packet in packets:
        if packet.pts is None:
            raise ValueError("it has packets without a time")
        if packet.dts is None:  # in Matroska, of the first packets after a seek
            packet.dts = last.get(packet.stream_index, packet.pts - _MOST_REORDERED) + 1
        last[packet.stream_index] = packet.dts
        time, is_video = packet.pts * packet.time_base, packet.stream_index == video.index
        if is_video and packet.is_keyframe:
            if packet.is_discard and begin == math.inf:
                raise ValueError("an edit list hides its first frames")
            begin = min(begin, time)
            if time >= end and stop == math.inf:
                stop, held = time, [packet]
        if is_video and time > stop + _AUDIO_LAG:
            return
        if begin <= time < stop:
            for item in [*(held if is_video else ()), packet]:
                shift = round(begin / item.time_base)
                item.pts, item.dts = (item.pts or 0) - shift, (item.dts or 0) - shift
                yield item
            held = [] if is_video else held


def encode_part(
    source: Path, start: Fraction, end: Fraction, target: Path, settings: Settings, *, name: Path
) -> None:
    """Encode a part of a video, exact to the frame, with its audio.

    Parameters
    ----------
    start, end
        Seconds from the first frame; frames with start ≤ time < end are written.
    name
        The name of the target in messages.

    Any damage is tolerated. Other errors as for `VideoReader` and `VideoWriter`.
    """
    tolerant = settings.input.model_copy(update={"max_damaged": 1.0})
    with (
        VideoReader(source, start=start, end=end, settings=tolerant) as reader,
        VideoWriter(target, reader.info, settings.output, name=name, whole_audio=False) as writer,
    ):
        for frame in reader:
            writer.write(frame)

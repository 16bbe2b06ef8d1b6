"""Write videos: frames as H.264 with the audio of their source, or parts copied as they are."""

import contextlib
import logging
import math
from collections.abc import Generator, Iterable, Iterator
from contextlib import closing
from dataclasses import asdict
from fractions import Fraction
from pathlib import Path
from typing import Self

import av
from av.audio.stream import AudioStream
from av.container import OutputContainer
from av.packet import Packet
from av.stream import Stream
from av.video.reformatter import ColorRange

from vdet.config.schema import OutputSettings, Settings
from vdet.errors import OutputError, VideoError
from vdet.media.frame import MATRIX_CODES, UNSPECIFIED, Frame, VideoInfo
from vdet.media.images import is_image_name
from vdet.media.reader import PLAYED_AUDIO, SAFELY, Decoder, Demuxer, VideoReader, codec_name
from vdet.version import __version__

_log = logging.getLogger("vdet")

VIDEO_SUFFIXES = (".mp4", ".mov", ".mkv")

_X264 = "b-adapt=0:scenecut=0:b-pyramid=none"
"""Parameters of x264: no search of later frames for scene cuts and frame types, which would take a
tenth of a run and save 1 % of the file size; and no B-frames as references, for fewer frames in
memory: files are 2 % larger.
"""
_AAC_RATE = 48_000
"""Samples a second of audio whose own rate AAC does not have."""
_MARKED = "made by vdet"
MARK = f"{_MARKED} {__version__}"
"""Comment in the metadata of every video that vdet writes."""
_MP4 = (b"ftyp", b"styp", b"moov", b"moof", b"mdat", b"free", b"skip", b"wide")  # first boxes
_FINEST = 10_000_000  # ticks a second; more is not safe in mp4 players

_AUDIO_LAG = 1  # seconds of video after the end in which audio of the part may still follow
_MOST_REORDERED = 17  # frames in H.264 and H.265, and one


class AudioCopy:
    """Copies the packets of every audio stream of `source` to `target`, bit for bit.

    Streams that the target does not support are encoded as AAC; so are those that browsers do not
    play in mp4. Times stay relative to the video: second `origin` of the source becomes second 0
    of the target. Earlier packets are dropped, except one if the target can hide it (mp4 and mov),
    because a decoder needs it to start. Damaged packets, and empty streams, are dropped with a
    warning (logger "vdet"). Create it before anything is written to `target`.

    Raises
    ------
    VideoError
        `source` cannot be opened.
    """

    def __init__(self, source: Path, target: OutputContainer, origin: Fraction) -> None:
        self._path = source
        self._target = target
        self._origin = origin
        self._can_hide = target.format.name != "matroska"
        self._dropped = 0  # packets
        self._encoded: set[int] = set()  # streams, by their index in the source
        self._source = Demuxer(source)
        self._streams = self._add_streams()
        self._packets = self._shifted_packets()
        self._next = next(self._packets, None)

    def copy(self, until: Fraction | None) -> None:
        """Copy packets that begin before second `until` of the target; None for all."""
        while packet := self._next:
            if until is not None and (packet.pts or 0) * packet.time_base >= until:
                return
            try:
                self._target.mux(packet)
            except av.InvalidDataError:  # found when repacking for another container
                self._dropped += 1
            self._next = next(self._packets, None)

    def close(self) -> None:
        """Close the source; warn about packets that could not be copied."""
        if self._dropped:
            fault = "damaged, or without a time of their own"
            _log.warning("%s: %d audio packets dropped: %s", self._path, self._dropped, fault)
        self._packets.close()
        self._source.close()

    def _add_streams(self) -> dict[int, AudioStream]:
        """Add the supported streams to the target, by their index in the source."""
        streams, target = {}, self._target
        for stream in self._source.container.streams.audio:
            codec = stream.codec_context
            if not (codec and codec.sample_rate):
                name = codec.name if codec else "unknown codec"
                _log.warning("%s: its audio (%s) is empty; left out", self._path, name)
            elif codec.name in target.supported_codecs and (
                target.format.name != "mp4" or codec_name(stream) in PLAYED_AUDIO
            ):
                streams[stream.index] = target.add_stream_from_template(stream)
            else:
                rates = av.Codec("aac", "w").audio_rates or ()
                rate = codec.sample_rate if codec.sample_rate in rates else _AAC_RATE
                layout = "mono" if codec.channels == 1 else "stereo"
                streams[stream.index] = target.add_stream("aac", rate, layout=layout)
                self._encoded.add(stream.index)
        return streams

    def _shifted_packets(self) -> "Generator[Packet[Stream], None, None]":
        """Yield the packets to copy, with their times and stream in the target."""
        if not self._streams:
            return
        last: dict[int, int] = {}
        copied = [self._source.container.streams[index] for index in self._streams]
        for packet in self._source.packets(copied):
            index, pts, dts = packet.stream_index, packet.pts, packet.dts
            if pts is None or dts is None or dts <= last.get(index, dts - 1):
                self._dropped += 1  # muxers reject times that do not increase
                continue
            last[index] = dts
            if index in self._encoded:
                yield from self._encoded_packets(packet)
                continue
            shift = round(self._origin / packet.time_base)
            packet.pts, packet.dts = pts - shift, dts - shift
            if packet.pts + (packet.duration or 0) * self._can_hide >= 0:
                packet.stream = self._streams[index]
                yield packet
        for index in self._encoded:
            yield from self._streams[index].encode(None)

    def _encoded_packets(self, packet: "Packet[Stream]") -> "Iterator[Packet[Stream]]":
        """Yield a packet of the source as packets of AAC."""
        try:
            frames = packet.decode()
        except av.InvalidDataError:
            frames, self._dropped = [], self._dropped + 1
        for frame in frames:
            if isinstance(frame, av.AudioFrame) and frame.pts is not None and frame.time_base:
                frame.pts -= round(self._origin / frame.time_base)
                if frame.pts >= 0:
                    yield from self._streams[packet.stream_index].encode(frame)


def is_marked(path: Path) -> bool:
    """Return whether a file is a video that vdet wrote: see `MARK`."""
    return (_comment(path) or "").startswith(_MARKED)


def may_replace_video(path: Path) -> bool:
    """Return whether a video may replace this file: vdet wrote it, or it is not a video.

    An unreadable file that begins like an MP4 file is kept: it may be a truncated recording that
    can be repaired.
    """
    if not path.is_file():
        return path.is_symlink()  # its target does not exist
    if (comment := _comment(path)) is not None:
        return comment.startswith(_MARKED)
    with contextlib.suppress(OSError), path.open("rb") as file:
        return file.read(8)[4:] not in _MP4
    return False


def _comment(path: Path) -> str | None:
    """Return the comment in the metadata of a video; None if the file is not a video."""
    try:
        with av.open(str(path.absolute()), options=SAFELY, metadata_errors="replace") as container:
            tags = {key.lower(): text for key, text in container.metadata.items()}
    except av.FFmpegError:
        return None
    return tags.get("comment", "")


class VideoWriter:
    """Writes frames as H.264, yuv420p, with the audio of their source; a context manager.

    The file is complete only when the ``with`` block has ended without an exception. For an output
    that appears complete or not at all, write to a file from `vdet.files.OutputFiles`.

    The first frame is at second 0, all others keep their exact distance from it (mkv: to the
    millisecond), and the last one lasts one period of the average rate. Odd sides grow by one
    pixel, which repeats the last row or column, because 4:2:0 needs even sides. Colours are coded
    like the planes of the source (`VideoInfo.coding`), and tagged if the source is tagged.
    Unchanged planes are encoded as decoded. Audio packets are copied, not encoded again. Creation
    time, location and title are kept.

    Parameters
    ----------
    path
        The file to write, .mp4, .mov or .mkv.
    info
        Properties of the source; frames must have its width and height.
    settings
        Preset and quality.
    name
        The name of the file in messages, if it is not `path`.
    whole_audio
        True: copy the audio to its end. False: end it with the last frame, for a part of the
        source.
    threads
        Number of threads of the encoder; None: it chooses.

    Raises
    ------
    OutputError
        The suffix is not supported, or the file cannot be written (from every method).
    VideoError
        No frame was written (at the end), or the source of the audio cannot be opened.
    """

    def __init__(
        self,
        path: Path,
        info: VideoInfo,
        settings: OutputSettings,
        *,
        name: Path | None = None,
        whole_audio: bool = True,
        threads: int | None = None,
    ) -> None:
        self._name = name or path
        if path.suffix.lower() not in VIDEO_SUFFIXES:
            raise OutputError(f"{self._name}: videos must end in {', '.join(VIDEO_SUFFIXES)}")
        self._info = info
        self._whole_audio = whole_audio
        self._period = 1 / info.rate
        self._time_base = max(info.time_base, Fraction(1, _FINEST))
        self._origin: Fraction | None = None  # time of the first frame
        self._last = -1
        self._audio: AudioCopy | None = None
        self._failure: OutputError | None = None
        flags = {"movflags": "+faststart"}
        with self._naming_the_file():
            self._container = av.open(str(path.absolute()), mode="w", container_options=flags)
        tags = {name: value for name, value in asdict(info.tags).items() if value}
        self._container.metadata.update(tags, comment=MARK)
        self._stream = self._add_picture(settings, threads)

    def write(self, frame: Frame) -> None:
        """Encode the next frame, and copy the audio up to it; times must increase.

        After an error, every call raises it again.
        """
        with self._naming_the_file():
            if self._origin is None:
                self._origin = frame.time
                if self._info.has_audio:
                    begin = self._info.start + frame.time
                    self._audio = AudioCopy(self._info.path, self._container, begin)
            since = frame.time - self._origin
            last, self._last = self._last, max(self._last + 1, round(since / self._time_base))
            pause = (self._last - last) * self._time_base
            # FFmpeg writes no coarser ticks than 20,000 a second.
            is_too_long = pause * max(self._time_base.denominator, 20_000) >= 2**31
            if is_too_long and self._container.format.name != "matroska":
                raise OutputError(f"{self._name}: cannot hold a pause of {int(pause)} s; use .mkv")
            picture = frame.picture.to_encode(self._info.coding)
            picture.pts, picture.time_base = self._last, self._time_base
            picture.duration = round(self._period / self._time_base)
            self._container.mux(self._stream.encode(picture))
            if self._audio:
                self._audio.copy(since)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None:
                with self._naming_the_file():
                    self._finish()
        finally:
            with contextlib.suppress(av.FFmpegError):
                self._container.close()
            if self._audio:
                self._audio.close()

    def _finish(self) -> None:
        """Write the frames still in the encoder, the remaining audio, and the index of the file."""
        if self._origin is None:
            raise VideoError(f"{self._name}: no frames to write; check the times")
        self._container.mux(self._stream.encode(None))
        if self._audio:
            end = self._last * self._time_base + self._period
            self._audio.copy(None if self._whole_audio else end)
        self._container.close()

    @contextlib.contextmanager
    def _naming_the_file(self) -> Iterator[None]:
        if self._failure:  # FFmpeg crashes if packets follow after its header failed
            raise self._failure
        try:
            yield
        except av.FFmpegError as error:
            self._failure = OutputError(f"{self._name}: cannot be written: {error.strerror}")
            raise self._failure from error

    def _add_picture(self, settings: OutputSettings, threads: int | None) -> av.VideoStream:
        options = {"preset": settings.preset, "crf": str(settings.crf), "x264-params": _X264}
        info, color = self._info, self._info.color
        stream = self._container.add_stream("libx264", rate=info.rate, options=options)
        context = stream.codec_context
        context.width, context.height = info.width + info.width % 2, info.height + info.height % 2
        context.thread_count, context.pix_fmt = threads or 0, "yuv420p"
        context.time_base, context.sample_aspect_ratio = self._time_base, info.pixel_aspect
        context.color_primaries, context.color_trc = color.primaries, color.transfer
        if color.matrix != UNSPECIFIED:
            context.colorspace = MATRIX_CODES[info.coding.matrix]
            context.color_range = ColorRange.MPEG
        if info.coding.full_range:
            context.color_range = ColorRange.JPEG
        return stream


def can_be_copied(source: Path) -> bool:
    """Return whether parts of a video can be copied into an `.mp4` file that browsers play.

    Copies need a file with times of its own, one clock, and key frames that are shown.
    """
    if not source.is_file() or is_image_name(source):
        return False
    decoder = Decoder(source, None)
    with closing(decoder.demuxer) as demuxer:
        has_times = not (demuxer.may_restart or demuxer.is_raw or decoder.lacks_shown_times)
        return has_times and demuxer.plays and decoder.shows_key_frame()


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
                if packet.stream_index == demuxer.video.index and not packet.duration:
                    # An `.mp4` file would hide a last frame without a duration.
                    packet.duration = round(1 / (demuxer.rate * packet.time_base))
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

"""Read a video: upright frames with their exact times, and packets despite damage."""

import itertools
import logging
import math
import os
import re
from collections import deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from fractions import Fraction
from pathlib import Path
from typing import Self

import av
import cv2
import numpy as np
from av.container import InputContainer
from av.filter import Graph
from av.packet import Packet
from av.stream import Discard, Disposition, Stream
from av.video.stream import VideoStream

from vdet.boxes import Image
from vdet.config.schema import InputSettings
from vdet.errors import ImageError, VideoError
from vdet.media.frame import Coding, ColorTags, Frame, Picture, Planes, Tags, VideoInfo, bgr_of
from vdet.media.images import (
    ASSUMED_RATE,
    Orientation,
    numbered_images,
    read_encoded,
    read_header,
    upright,
)

_log = logging.getLogger("vdet")
_DEFAULTS = InputSettings()
_MAX_SIDE = 16_384  # pixels; H.264 cannot be written larger
_SLOW_MOTION = 1.5  # ratio of rates; in darkness, a camera may also record at a lower rate
_TOLERANCE = Fraction(1, 100)  # fraction of its duration that an intact file may lack

MAX_PIXELS = 8192 * 4608
"""Maximum for a frame. 8K video, in both widths, has fewer; a damaged header may claim more."""

_STREAM = re.compile(r"[a-z][a-z0-9+.-]+:/|-$", re.IGNORECASE)  # "rtsp://…" as a path, or "-"

# Formats that contain their pictures: not formats that refer to other files or addresses (such as
# playlists), nor text that would be rendered as a picture.
_FORMATS = (
    "apng,asf,av1,avi,cavsvideo,dhav,dv,flv,gif,h263,h264,hevc,ivf,live_flv,m4v,matroska,mjpeg,"
    "mov,mpeg,mpegts,mpegtsraw,mpegvideo,mpjpeg,mxf,nut,obu,ogg,rm,vc1,vvc,wtv,yuv4mpegpipe"
)
SAFELY = {"format_whitelist": _FORMATS, "max_pixels": str(MAX_PIXELS)}
"""Options for opening any file: only these formats, and no larger frames when probing."""

HDR_TRANSFERS = (16, 18)
"""PQ and HLG, in codes of ITU-T H.273."""
_RATES = 1, 240
"""Usual frames per second; another number in a raw stream is the unit of its clock."""
_EXPORTER = re.compile(
    r"Lav[fc]|HandBrake|Adobe|Blackmagic|DaVinci|VLC|vlc|iMovie|Final Cut|GPAC|MP4Box|L-SMASH|Wowza"
    r"|mkvmerge|libebml|Bento4|Shaka|ISO Media file produced by Google|\w*dash"
)
"""Start of the name of a program that encodes videos again, or copies them, and the brand of parts
for streaming.
"""
_MAX_TERM = 1_000_000  # of a rate as a fraction; the encoder has 32-bit integers

PLAYED_AUDIO = {"aac", "mp3", "opus", "flac"}
"""Codecs that browsers play in an `.mp4` file."""
_PLAYED = {"h264", "vp9", "av1"}

_TS_DISCONT = 0x0200  # FFmpeg's flag of such formats: AVFMT_TS_DISCONT
_NO_TIMES = 0x0080  # likewise: AVFMT_NOTIMESTAMPS
_MAX_BACK = Fraction(1, 10)  # seconds; a larger step back begins a new part
_MAX_FORWARD = 10  # seconds; a larger jump forward begins a new part, as in the ffmpeg program
_MAX_FAILURES = 100  # in a row; a file with only errors must end too

_LONGEST_GROUP = 600  # maximum packets between key frames, which are kept in memory
_COUNTABLE = ("av1", "h264", "hevc", "libdav1d", "mjpeg", "mpeg2video", "mpeg4", "png", "vp9")
"""Codecs with one picture per packet."""
_LEADING = 17  # maximum pictures from a key packet to its picture, with those of an open group
_MAX_LATE = 32  # periods; a later picture means that the clock was set back
_FLAGGED = 2  # last packets of a part that seem incomplete where the next part begins


class VideoReader:
    """The frames of a video file, in order; a context manager. They can be read once.

    It yields the frames with ``start <= time < end``, at most `frames` of them. Seconds count from
    the first frame of the file, as in a player. Decoding begins at the key frame
    before `start` if the frames before it can be counted (see `Decoder`). Otherwise all frames are
    decoded, and those before `start` are dropped; the result is the same.

    The first video stream is read. Frames are rotated upright, and numbered images also mirrored,
    as the file says. HDR (PQ or HLG) is converted to BT.709. Frames of another size than the first
    are scaled to it. If the clock of a recording restarts, its parts follow one another. A time
    that is missing, or not later than the previous one, is estimated from the frame rate.

    Damaged packets are skipped. At the end, one warning (logger "vdet") reports the number of
    frames lost or damaged, an early end of the file, restarts of the clock, scaled frames, and
    unused video streams.

    Parameters
    ----------
    path
        The file, or numbered images such as `img_%04d.png`, without a gap.
    start, end
        Seconds after the file's first frame; None for no limit.
    frames
        Maximum number of frames; None for no limit.
    settings
        How much damage is tolerated, and the rate of numbered images or of a raw stream.

    Attributes
    ----------
    length
        Seconds from the first frame to the end of the last; None if unknown. It is the declared
        length until all frames are read.

    Raises
    ------
    VideoError
        The file is missing, is not a video, or no frame can be decoded; or `settings` has a rate
        that would change nothing. After the last frame: more frames were lost or damaged than
        `settings` tolerates.
    """

    def __init__(
        self,
        path: Path,
        *,
        start: Fraction | None = None,
        end: Fraction | None = None,
        frames: int | None = None,
        settings: InputSettings = _DEFAULTS,
    ) -> None:
        self._start, self._end, self._limit = start or Fraction(0), end, frames
        self._settings = settings
        self._faults: list[str] = []
        self._is_scaled = False
        self._decoder = Decoder(path, settings.frame_rate)
        if settings.frame_rate is not None and self._decoder.demuxer.has_own_rate:
            self._decoder.demuxer.close()
            raise VideoError(f"{path}: has a frame rate of its own; remove input.frame_rate")
        first = next(self._decoder.pictures, None)
        if first is None or max(first.width, first.height) > _MAX_SIDE:
            limits = f"{MAX_PIXELS // 10**6} million pixels and sides of {_MAX_SIDE}"
            advice = f"use a file that plays, with frames of at most {limits}"
            raise VideoError(f"{path}: no frame can be decoded; {advice}")
        stream = self._decoder.stream
        demuxer = self._decoder.demuxer
        self.info: VideoInfo = describe(path, demuxer, first)
        self.length: Fraction | None = None
        if demuxer.images:
            self.length = self.info.duration
        elif not (demuxer.may_restart or demuxer.is_raw):
            self.length = stated_duration(stream, self.info.start)
        self._to_standard_range = _standard_range_filter(first.color_trc, stream)
        self._faults += self._assumptions()
        self._frames = self._deliver(self._begin(first))

    @property
    def damaged(self) -> int:
        """Number of frames lost or damaged so far."""
        return self._decoder.damage.damaged

    @property
    def expected(self) -> int | None:
        """The approximate number of frames; None if the file does not declare it."""
        if (last := self.info.frames) is None:
            return None
        if self._end is not None:
            last = min(last, math.ceil(self._end * self.info.rate))
        count = max(0, last - math.ceil(self._start * self.info.rate))
        return count if self._limit is None else min(count, self._limit)

    def __iter__(self) -> Iterator[Frame]:
        return self._frames

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._frames.close()
        self._decoder.demuxer.close()

    def _assumptions(self) -> Iterator[str]:
        """Yield assumptions that the user should know."""
        demuxer = self._decoder.demuxer
        if self._settings.frame_rate is None and not demuxer.has_own_rate:
            noun = "images" if demuxer.images else "frames"
            yield f"{ASSUMED_RATE} {noun} per second are assumed; set input.frame_rate"
        captured, shown = capture_rate(demuxer.video) or 0, float(self.info.rate)
        if captured > _SLOW_MOTION * shown:
            rates = f"recorded at {captured:g} frames per second, shown at {shown:.3g}"
            yield f"is slow motion: {rates}; speeds are too low by this ratio"
        if demuxer.container.streams.audio and not self.info.has_audio:
            yield "its audio is dropped: a pipe can be read only once"
        streams = len(moving_streams(demuxer.container))
        if streams > 1:
            yield f"has {streams} video streams; only the first is used"

    def _begin(self, first: av.VideoFrame) -> av.VideoFrame:
        """Return the picture at which decoding begins."""
        time = math.floor((self.info.start + self._start) / self.info.time_base)
        is_countable = self._decoder.is_countable and not first.interlaced_frame
        if not is_countable or first.pts is None or time <= first.pts:
            return first
        decoder = Decoder(self.info.path, self._settings.frame_rate)
        key = decoder.skip_to(time, first.pts)
        picture = None if key is None else next(decoder.pictures, None)
        # With intra refresh, the pictures after a key frame need older ones too.
        if picture is None or picture.pts != key or decoder.damage.is_evident:
            decoder.demuxer.close()
            return first
        self._decoder.demuxer.close()
        self._decoder = decoder
        return picture

    def _deliver(self, first: av.VideoFrame) -> Generator[Frame, None, None]:
        try:
            yield from itertools.islice(self._selected(first), self._limit)
            self._report()
        finally:
            self._decoder.demuxer.close()

    def _selected(self, first: av.VideoFrame) -> Iterator[Frame]:
        info, period, time = self.info, 1 / self.info.rate, None
        pictures = itertools.chain([first], self._decoder.pictures)
        are_numbers = bool(self._decoder.demuxer.images)  # the times of images
        for count, picture in enumerate(pictures, self._decoder.before):
            index = picture.pts if are_numbers and picture.pts is not None else count
            stated = None if picture.pts is None else picture.pts * info.time_base
            time = next_time(time, stated, period)
            since = time - info.start
            if self._end is not None and since >= self._end:
                return
            if since >= self._start:
                yield Frame(index, since, self._upright(picture))
        shown = max(period, picture.duration * info.time_base)
        declared, self.length = self.length, since + shown
        if declared and declared - self.length > max(2 * period, declared * _TOLERANCE):
            self._faults.append(f"ends early: {index + 1} of {info.frames} frames could be read")

    def _upright(self, picture: av.VideoFrame) -> Picture:
        """Return a picture as planes if they need no conversion, else as BGR."""
        info = self.info
        has_same_size = (picture.width, picture.height) == (info.width, info.height)
        is_ready = info.orientation == Orientation() and not self._to_standard_range
        if has_same_size and is_ready and Coding.of(picture) == info.coding:
            return Picture(Planes(picture, info.coding))
        return Picture(self._image(picture))

    def _image(self, picture: av.VideoFrame) -> Image:
        info = self.info
        try:
            if self._to_standard_range:
                self._to_standard_range.vpush(picture)
                picture = self._to_standard_range.vpull()
            image = bgr_of(picture)
        except (av.FFmpegError, ValueError) as error:
            fault = f"its pixels ({picture.format.name}) cannot be converted"
            raise VideoError(f"{info.path}: {fault}; convert it to H.264 first") from error
        image = upright(image, info.orientation)
        size = info.width, info.height
        if image.shape[1::-1] == size:
            return image
        self._is_scaled = True
        return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)

    def _report(self) -> None:
        """Raise `VideoError` if too much is damaged; warn about other faults."""
        damaged, total = self.damaged, self._decoder.damage.pictures + self._decoder.damage.lost
        if damaged:
            self._faults.insert(0, f"{damaged} of {total} frames damaged or lost")
        if damaged > math.ceil(self._settings.max_damaged * total):
            allowed = f"{self._settings.max_damaged:g}"
            limit = f"more than input.max_damaged: {allowed} allows; raise it, as in 0.5 for half"
            raise VideoError(f"{self.info.path}: {self._faults[0]}, {limit}")
        if restarts := self._decoder.demuxer.restarts:
            self._faults.append(f"its clock restarts {restarts}×; the parts follow one another")
        if self._is_scaled:
            self._faults.append("frames of other sizes are scaled to the first")
        if self._faults:
            _log.warning("%s: %s", self.info.path, "; ".join(self._faults))


def _standard_range_filter(transfer: int, stream: VideoStream) -> Graph | None:
    """Return the filter that converts HDR video to BT.709; None for other video."""
    if transfer not in HDR_TRANSFERS:
        return None
    graph = Graph()
    colors = "out_transfer=bt709:out_primaries=bt709:out_color_matrix=bt709"
    graph.link_nodes(
        graph.add_buffer(template=stream),
        graph.add("scale", f"{colors}:intent=relative_colorimetric"),
        graph.add("format", "bgr24"),
        graph.add("buffersink"),
    ).configure()
    return graph


def next_time(last: Fraction | None, stated: Fraction | None, period: Fraction) -> Fraction:
    """Return the time of a frame, later than that of the previous frame, `last`; seconds.

    It is the `stated` time if that is later, else one period after the previous frame.
    """
    if last is None:
        return stated or Fraction(0)
    return last + period if stated is None or stated <= last else stated


def _open(path: Path, images: Sequence[Path], rate: Fraction) -> InputContainer:
    """Open a video file, or the first of its numbered images.

    Raises
    ------
    VideoError
        The file does not exist, cannot be read, is not a video, or is an address.
    """
    file, container_format, options = path, None, SAFELY
    if images:
        file, container_format = images[0], "image2"
        options = {"framerate": str(rate), "pattern_type": "none"}
    elif path.suffix.lower() in (".mjpeg", ".mjpg"):
        container_format = "mjpeg"  # else FFmpeg may treat it as a pipe of images, which it rejects
    reject_address(path)
    if not os.path.exists(file):  # noqa: PTH110  # also False if it is not accessible
        raise VideoError(f"{path}: not found; check the name")
    if file.is_file() and not file.stat().st_size:
        raise VideoError(f"{path}: is empty; use a file that plays")
    name = str(file.absolute())  # "a:b.mp4" would be treated as a protocol
    try:  # tags may have any encoding
        return av.open(name, "r", container_format, options, metadata_errors="replace")
    except av.FFmpegError as error:
        fault = f"cannot be opened, is not a video, or was cut off ({error.strerror})"
        raise VideoError(f"{path}: {fault}; use a file that plays") from error


def reject_address(path: Path) -> None:
    """Raise `VideoError` if `path` is an address, or ``-``."""
    if not path.exists() and _STREAM.match(str(path)):
        raise VideoError(f"{path}: streams are not supported; save it to a file first")


def is_pipe(path: Path) -> bool:
    """Return whether `path` can be read only once, like a FIFO."""
    return path.exists() and not path.is_file() and not path.is_dir()


def codec_name(stream: Stream) -> str | None:
    """Return the name of the codec of a stream, whichever decoder is used; None if unknown."""
    codec = stream.codec_context
    return codec.codec.canonical_name if codec else None


def plays_in_some_browser(path: Path) -> bool:
    """Return whether there are browsers that play a video file."""
    with closing(Demuxer(path)) as demuxer:
        is_read = demuxer.container.format.name.startswith(("mov,", "matroska,"))
        return is_read and codec_name(demuxer.video) in _PLAYED | {"hevc", "vp8"}


def moving_streams(container: InputContainer) -> list[VideoStream]:
    """Return the video streams, without covers and thumbnails."""
    stills = Disposition.attached_pic | Disposition.timed_thumbnails
    return [stream for stream in container.streams.video if not stream.disposition & stills]


def describe(path: Path, demuxer: "Demuxer", first: av.VideoFrame) -> VideoInfo:
    """Describe a video, of which the `first` picture has been decoded."""
    container, stream, rate = demuxer.container, demuxer.video, demuxer.rate
    time_base = time_base_of(stream)
    start = (first.pts or 0) * time_base
    duration = None if demuxer.is_raw else stated_duration(stream, start)
    if duration is None and container.duration and not demuxer.is_raw:  # of the longest stream
        duration = Fraction(container.duration, av.time_base)
    orientation = Orientation.of_frame(first)
    if demuxer.images:
        _, orientation = read_header(demuxer.images[0])
        duration = len(demuxer.images) / rate
    is_hdr = first.color_trc in HDR_TRANSFERS
    colors = ColorTags(first.color_primaries, first.color_trc, first.colorspace)
    width, height, aspect = first.width, first.height, stream.sample_aspect_ratio or Fraction(1)
    if orientation.is_sideways:
        width, height, aspect = height, width, 1 / aspect
    return VideoInfo(
        path=path,
        width=width,
        height=height,
        rate=rate,
        time_base=time_base,
        start=start,
        frames=stream.frames or (round(duration * rate) if duration else None),
        duration=duration,
        orientation=orientation,
        pixel_aspect=aspect,
        color=ColorTags(1, 1, 1) if is_hdr else colors,
        coding=(not is_hdr and orientation == Orientation() and Coding.of(first)) or Coding(),
        has_audio=bool(container.streams.audio) and not is_pipe(path),
        tags=_tags(stream, start),
    )


def capture_rate(stream: VideoStream) -> float | None:
    """Return how many frames per second were recorded, if an Android camera says so."""
    with suppress(KeyError, ValueError):
        return float(_metadata(stream)["com.android.capture.fps"])
    return None


def _metadata(stream: VideoStream) -> dict[str, str]:
    """Return the metadata of a stream and its file, with names in lower case."""
    metadata = (stream.metadata | stream.container.metadata).items()
    return {name.lower(): value for name, value in metadata}


def _tags(stream: VideoStream, start: Fraction) -> Tags:
    """Return metadata of the recording; the names differ between containers.

    `start` is the time of the first frame in the file, seconds.
    """
    tags = _metadata(stream)
    if stream.container.format.name == "dhav":  # times are those of the camera's clock since 1970
        time = datetime.fromtimestamp(float(start), UTC).replace(tzinfo=None)
        tags["creation_time"] = time.isoformat()
    location = tags.get("location") or tags.get("com.apple.quicktime.location.iso6709")
    recorded = tags.get("com.apple.quicktime.creationdate")  # with a zone, and kept by exports
    keys = "encoder", "handler_name", "major_brand", "compatible_brands"
    exporter = next(filter(_EXPORTER.match, (tags.get(key, "") for key in keys)), None)
    return Tags(
        creation_time=recorded or tags.get("creation_time"),
        location=location,
        title=tags.get("title"),
        exporter=None if recorded else exporter,
    )


def stated_duration(stream: VideoStream, start: Fraction) -> Fraction | None:
    """Return the declared time from the first frame to the end of the stream, seconds.

    None if it is not declared. `start` is the time of the first frame. In MP4, hidden frames may
    precede it, and fragments declare the end, in times of decoding. Matroska declares the end in a
    tag.
    """
    is_fragmented = "mp4" in stream.container.format.name and not stream.frames
    if stream.duration and is_fragmented and stream.index_entries:
        return (stream.duration - stream.index_entries[0].timestamp) * time_base_of(stream)
    if stream.duration:
        return ((stream.start_time or 0) + stream.duration) * time_base_of(stream) - start
    with suppress(KeyError, ValueError, ZeroDivisionError):
        hours, minutes, seconds = map(Fraction, stream.metadata["DURATION"].split(":"))
        return hours * 3600 + minutes * 60 + seconds - start
    return None


def _stated_rate(stream: VideoStream, *, is_raw: bool) -> Fraction | None:
    """Return the frame rate that a file declares, on average; None if it does not.

    FFmpeg's average of a raw stream is an assumption. What that declares may be its unit of time.
    """
    if is_raw:
        declared = stream.codec_context.framerate
        return declared if declared and _RATES[0] <= declared <= _RATES[1] else None
    rate = stream.average_rate or stream.guessed_rate
    return (rate and rate.limit_denominator(_MAX_TERM)) or None


def time_base_of(stream: VideoStream) -> Fraction:
    """Return the unit of the times of a stream, in seconds."""
    return stream.time_base or Fraction(1, 90_000)


class Demuxer:
    """An open video file, whose packets are read in file order, on one continuous time line.

    Numbered images are packets too; FFmpeg's own reader of them would end at an empty one.

    If its clock restarts, each stream enters the next part where its own clock jumps, because
    packets of both parts alternate near the joint. The first stream in a part determines its
    offset. `frame_rate` is that of numbered images or of a raw stream, in place of what that says.

    Attributes
    ----------
    images
        The numbered images; empty for a file.
    container
        The file, or the first image.
    video
        The video stream, whose restarts count.
    is_raw
        Whether packets have no times, as in a raw stream.
    has_own_rate
        Whether the file declares its frame rate, or has times; False if `frame_rate` replaces it.
    rate
        Frames per second; `ASSUMED_RATE` if it is unknown.
    may_restart
        Whether the clock may restart in files of this format.
    restarts
        How often it has restarted.

    Raises
    ------
    VideoError
        The file cannot be opened, or has no video stream, or one of an unknown codec; or numbered
        images are missing.
    """

    def __init__(self, path: Path, frame_rate: float | None = None) -> None:
        assumed = Fraction(str(frame_rate)) if frame_rate else ASSUMED_RATE
        self.images = numbered_images(path)
        self.container = _open(path, self.images, assumed)
        streams = moving_streams(self.container)
        if not streams:
            raise VideoError(f"{path}: has no video stream; use a video file")
        self.video = streams[0]
        if self.video.codec_context is None:
            raise VideoError(f"{path}: its codec is unknown; convert it to H.264 first")
        self.restarts = 0
        self.may_restart = bool(self.container.format.flags & _TS_DISCONT)
        self.is_raw = not self.images and bool(self.container.format.flags & _NO_TIMES)
        stated = None
        if not (self.is_raw and frame_rate):
            stated = _stated_rate(self.video, is_raw=self.is_raw)
        self.has_own_rate = not self.images and (stated is not None or not self.is_raw)
        self.rate = stated or (assumed if self.is_raw else ASSUMED_RATE)
        self._period = 1 / self.rate
        self._offsets = [Fraction(0)]  # of each part, seconds; the first part keeps its clock
        self._part_of: dict[int, int] = {}  # the current part of each stream
        self._ends: dict[int, Fraction] = {}  # of each stream, seconds on the time line

    def close(self) -> None:
        """Close the file."""
        self.container.close()

    @property
    def plays(self) -> bool:
        """Whether every browser plays its streams in an `.mp4` file."""
        codecs = {codec_name(stream) for stream in self.container.streams.audio}
        pixels = self.video.codec_context.pix_fmt
        is_played = codec_name(self.video) in _PLAYED and pixels in ("yuv420p", "yuvj420p")
        return is_played and codecs <= PLAYED_AUDIO

    def packets(
        self, streams: Sequence[Stream], on_error: Callable[[], None] = lambda: None
    ) -> "Iterator[Packet[Stream]]":
        """Yield the packets of `streams`, and skip what cannot be read.

        `on_error` is called for each part of the file that is skipped.
        """
        if self.images:
            yield from self._image_packets(on_error)
            return
        selected = {stream.index for stream in streams}
        needed = [self.video, *self.container.streams.audio] if self.may_restart else streams
        for packet in self._readable({stream.index: stream for stream in needed}, on_error):
            ticks = packet.pts if packet.dts is None else packet.dts
            if self.may_restart and ticks is not None:
                self._move(packet, ticks * packet.time_base)
            if packet.stream_index in selected:
                yield packet

    def _image_packets(self, on_error: Callable[[], None]) -> "Iterator[Packet[Stream]]":
        for number, file in enumerate(self.images):
            data = b""
            with suppress(ImageError):
                data = read_encoded(file)
            if not data:  # an empty packet would end the decoder
                on_error()
                continue
            packet: Packet[Stream] = Packet(data)
            packet.stream, packet.time_base = self.video, time_base_of(self.video)
            packet.pts = packet.dts = number
            packet.is_keyframe = True
            yield packet

    def _readable(
        self, needed: Mapping[int, Stream], on_error: Callable[[], None]
    ) -> "Iterator[Packet[Stream]]":
        for stream in self.container.streams:
            stream.discard = Discard.default if stream.index in needed else Discard.all
        failures = 0
        while failures < _MAX_FAILURES:
            try:
                for packet in self.container.demux(*needed.values()):
                    failures = 0
                    if packet.size:  # an empty packet would end the decoder
                        yield packet
                return
            except IndexError:  # from PyAV, at the end, if a stream appeared while reading
                return
            except av.FFmpegError:
                failures += 1
                if failures == 1:
                    on_error()

    def _move(self, packet: "Packet[Stream]", begin: Fraction) -> None:
        """Add the offset of its part to the times of a packet, and note where it ends."""
        stream = packet.stream_index
        part = self._part_at(stream, begin)
        self.restarts += stream == self.video.index and part > self._part_of[stream]
        self._part_of[stream] = part
        duration = (packet.duration or 0) * packet.time_base or self._period
        end = begin + self._offsets[part] + duration
        self._ends[stream] = max(self._ends.get(stream, end), end)
        shift = round(self._offsets[part] / packet.time_base)
        packet.pts = None if packet.pts is None else packet.pts + shift
        packet.dts = None if packet.dts is None else packet.dts + shift

    def _part_at(self, stream: int, begin: Fraction) -> int:
        """Return the part, maybe a new one, in which a stream continues at a time of its clock."""
        newest, end = self._part_of.get(self.video.index, 0), self._ends.get(stream)
        for part in range(self._part_of.setdefault(stream, newest), len(self._offsets)):
            time = begin + self._offsets[part]
            if end is None or end - _MAX_BACK <= time <= max(self._ends.values()) + _MAX_FORWARD:
                return part
        self._offsets.append(max(self._ends.values()) - begin)
        return len(self._offsets) - 1


@dataclass(slots=True)
class Damage:
    """Counts errors, and corrupt and missing pictures, of one stream.

    Nothing counts as lost without evidence of damage: the first packets of an intact file may not
    yield pictures. With evidence, the number of lost pictures is that of errors, or of packets
    without a picture if this is larger.

    Attributes
    ----------
    period
        Time from one picture to the next, in units of the stream's time base.
    errors
        Unreadable parts of the file, and packets that cannot be decoded.
    restarts
        How often the clock restarts: the last packets before are flagged, but not corrupt.
    without_picture
        Packets without a picture, counted at the end of the stream.
    """

    period: Fraction
    errors: int = 0
    restarts: int = 0
    packets: int = 0
    pictures: int = 0
    corrupt_packets: int = 0
    without_picture: int = 0
    _corrupt_pictures: int = 0
    _last: int | None = None  # time of the last picture

    @property
    def is_evident(self) -> bool:
        """Whether there is evidence of damage."""
        return self.errors + self._corrupt_pictures + self._flagged > 0

    @property
    def lost(self) -> int:
        """Number of missing pictures."""
        return max(self.errors, self.without_picture * self.is_evident)

    @property
    def damaged(self) -> int:
        """Number of pictures lost or decoded with errors."""
        return max(self.lost + self._corrupt_pictures, self._flagged)

    @property
    def _flagged(self) -> int:
        return max(0, self.corrupt_packets - _FLAGGED * self.restarts)

    def receive(self, picture: av.VideoFrame) -> bool:
        """Count a picture; return whether it is usable.

        A late picture in a damaged stream is not usable, and counts as lost.
        """
        if self.is_evident and picture.pts is not None and self._last is not None:
            late = self._last - picture.pts
            if 0 <= late <= _MAX_LATE * self.period:
                return False
        self._last = picture.pts
        self.pictures += 1
        self._corrupt_pictures += picture.is_corrupt
        return True


class Decoder:
    """The pictures of the first video stream, in order of presentation.

    Parameters
    ----------
    frame_rate
        Rate of numbered images or of a raw stream, per second; None: as the stream says, else
        `ASSUMED_RATE`.

    Attributes
    ----------
    before
        Number of frames before the first picture.
    pictures
        The pictures that can be decoded.
    damage
        The damage so far.
    demuxer
        The file.
    is_countable
        Whether frames can be counted without decoding them.

    Raises
    ------
    VideoError
        The file cannot be read, or has no video stream.
    """

    def __init__(self, path: Path, frame_rate: float | None) -> None:
        self.before = 0
        self.demuxer = Demuxer(path, frame_rate)
        self.stream = self.demuxer.video
        context = self.stream.codec_context
        context.options = {"max_pixels": str(MAX_PIXELS)}
        context.thread_count = 1  # with more, frames near damage differ from run to run
        self.damage = Damage(1 / self.demuxer.rate / time_base_of(self.stream))
        self._times = deque[int]()  # of the packets of an AVI file that wait for their pictures
        self._is_avi = self.demuxer.container.format.name == "avi"
        self.is_countable = context.name in _COUNTABLE and not (self._is_avi or is_pipe(path))
        self._packets = self._read()
        self.pictures = self._decode()

    @property
    def lacks_shown_times(self) -> bool:
        """Whether the packets have no presentation times: in AVI files with B-frames."""
        return self._is_avi and self.stream.codec_context.has_b_frames

    def skip_to(self, time: int, first: int) -> int | None:
        """Begin at the last key frame at or before a time, and count the frames before it.

        Parameters
        ----------
        time, first
            This time, and the time of the first frame, in units of the time base.

        Returns
        -------
        The time of the key frame. None if the frames cannot be counted without decoding them:
        packets have no times or are damaged, or key frames are very rare. The decoder is then
        unusable.
        """
        group: list[Packet[Stream]] = []
        key, times = first, list[int]()
        for packet in self._packets:
            is_damaged = packet.is_corrupt or self.damage.errors
            if packet.pts is None or is_damaged or len(group) > _LONGEST_GROUP:
                return None
            if packet.is_keyframe and packet.pts <= time:
                key, group = packet.pts, []
            group.append(packet)
            if not packet.is_discard:  # otherwise the file marks it as hidden
                times.append(packet.pts)
            if packet.dts is not None and packet.dts > time:
                break
        self.before = sum(first <= pts < key for pts in times)
        following = itertools.chain(group, self._packets)
        # Pictures before the key frame may need older ones.
        self._packets = (packet for packet in following if packet.pts is None or packet.pts >= key)
        return key

    def shows_key_frame(self) -> bool:
        """Decode from the second key frame, and return whether it is shown; True without one.

        With intra refresh, it is not. The decoder is then unusable.
        """
        keys = (packet for packet in self._packets if packet.is_keyframe)
        key = next(itertools.islice(keys, 1, None), None)
        if key is None:
            return True
        self._packets = itertools.chain([key], self._packets)
        shown = itertools.islice(self.pictures, _LEADING)
        return key.pts is not None and any(picture.pts == key.pts for picture in shown)

    def _decode(self) -> Iterator[av.VideoFrame]:
        for packet in itertools.chain(self._packets, (None,)):
            if packet and not packet.is_discard:  # otherwise the file marks it as hidden
                self.damage.packets += 1
            try:
                decoded = self.stream.codec_context.decode(packet)
            except av.FFmpegError:
                self._fail()
                if self._times:
                    self._times.pop()
            else:
                for picture in decoded:
                    if self.lacks_shown_times:  # in order; AVI counts its empty packets too
                        picture.pts = self._times.popleft() if self._times else None
                    if self.damage.receive(picture):
                        yield picture
        if self.is_countable:
            self.damage.without_picture = self.damage.packets - self.damage.pictures

    def _read(self) -> "Iterator[Packet[Stream]]":
        """Yield the packets of the pictures."""
        for packet in self.demuxer.packets([self.stream], self._fail):
            if self.lacks_shown_times:
                packet.pts = packet.dts
                self._times += [] if packet.dts is None else [packet.dts]
            if self.demuxer.is_raw:
                packet.pts = packet.dts = packet.duration = None  # those of FFmpeg are assumed
            self.damage.corrupt_packets += packet.is_corrupt
            self.damage.restarts = self.demuxer.restarts
            yield packet

    def _fail(self) -> None:
        self.damage.errors += 1

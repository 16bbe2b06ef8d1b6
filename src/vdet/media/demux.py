"""Open a video file, read its packets despite damage, and describe what it declares."""

import os
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from fractions import Fraction
from pathlib import Path

import av
from av.container import InputContainer
from av.packet import Packet
from av.stream import Discard, Disposition, Stream
from av.video.stream import VideoStream

from vdet.errors import ImageError, VideoError
from vdet.files import record_input
from vdet.media.coding import HDR_TRANSFERS, Coding
from vdet.media.frame import ColorTags, Tags, VideoInfo
from vdet.media.images import PICTURE_SUFFIXES, Orientation, read_header
from vdet.media.mp4 import check_index, first_bytes
from vdet.media.numbered import ASSUMED_RATE, find_sequence

MAX_PIXELS = 8192 * 4608
"""Of a frame. 8K video, in both its widths, has fewer; a damaged header may claim far more."""

MAX_SIDE = 16_384
"""Pixels; H.264 cannot be written larger."""

_ADDRESS = re.compile(r"[a-z][a-z0-9+.-]+:/", re.IGNORECASE)  # "rtsp://…" as a path
_MAX_FAILURES = 100  # in a row; a file with nothing but errors must end too

# Formats that contain their pictures. Not among them are formats that name other files or addresses
# to be opened (such as playlists), and text that would be drawn as a picture.
_FORMATS = (
    "apng", "asf", "av1", "avi", "cavsvideo", "dhav", "dirac", "dv", "flv", "gif", "gxf", "h261",
    "h263", "h264", "hevc", "ivf", "kux", "live_flv", "m4v", "matroska", "mjpeg", "mjpeg_2000",
    "mov", "mpeg", "mpegts", "mpegtsraw", "mpegvideo", "mpjpeg", "mxf", "nut", "obu", "ogg", "rm",
    "vc1", "vvc", "wtv", "yuv4mpegpipe",
)  # fmt: skip


def open_input(
    path: Path, frame_rate: float | None = None, *, for_tags: bool = False
) -> InputContainer:
    """Open a video file, or numbered pictures (`img_%04d.png`, or a folder), for reading.

    Parameters
    ----------
    frame_rate
        Of numbered pictures, per second; None: `ASSUMED_RATE`.
    for_tags
        Only the tags of the file are wanted: no frame is decoded to learn more of its streams.

    Raises
    ------
    VideoError
        There is no such file, it cannot be read, it is not a video, or an address; a picture is
        missing.
    """
    refuse_stream(path)
    # "a:b.mp4" would be taken for a protocol; an absolute name is not.
    name, kind, options = str(path.absolute()), None, {"format_whitelist": ",".join(_FORMATS)}
    if sequence := find_sequence(path):
        name, kind = sequence.pattern, "image2"
        rate = Fraction(str(frame_rate or ASSUMED_RATE))
        options = {
            "framerate": f"{rate.numerator}/{rate.denominator}",
            "start_number": str(sequence.first),
            "start_number_range": "1",
        }
        if sequence.step > 1:
            name, options["pattern_type"] = sequence.glob, "glob"
    else:
        if not os.path.exists(path):  # noqa: PTH110  # False, too, where it cannot be looked at
            hint = ", or give numbered pictures as img_%04d.png" if "%" in path.name else ""
            raise VideoError(f"{path}: there is no such file; check the name{hint}")
        check_index(path)
        if _is_raw_mjpeg(path):
            kind = "mjpeg"  # FFmpeg may take it for a pipe of pictures, which is not read
    try:
        options["max_pixels"] = str(MAX_PIXELS)  # the file is probed with decoders
        if for_tags:
            options["codec_whitelist"] = "none"
        else:
            record_input(path)
        return av.open(name, "r", kind, options, metadata_errors="replace")  # tags: any encoding
    except (av.PermissionError, av.error.MemoryError) as error:
        raise VideoError(f"{path}: cannot be opened: {error.strerror}") from error
    except av.FFmpegError as error:
        raise VideoError(
            f"{path}: is not a video, or was cut off ({error.strerror}); give a file that plays"
        ) from error


def refuse_stream(path: Path) -> None:
    """Refuse an address, or ``-``. Raises `VideoError`."""
    if path.exists():
        return
    if _ADDRESS.match(str(path)):
        raise VideoError(f"{path}: streams are not read; record it into a file first")
    if path == Path("-"):
        raise VideoError("-: standard input is not read; give the name of a file")


def is_pipe(path: Path) -> bool:
    """Return whether `path` can be read only once, as a FIFO."""
    return path.exists() and not path.is_file() and not path.is_dir()


def _is_raw_mjpeg(path: Path) -> bool:
    """Return whether a file begins with a JPEG picture, and is not named as a single one."""
    is_jpeg = first_bytes(path).startswith(b"\xff\xd8\xff")
    return is_jpeg and path.suffix.lower() not in PICTURE_SUFFIXES


def packets(
    container: InputContainer, streams: Iterable[Stream], on_error: Callable[[], None]
) -> "Iterator[Packet[Stream]]":
    """Yield the packets of `streams` in file order; skip what cannot be read, and other streams.

    `on_error` is called at each place where something had to be skipped.
    """
    wanted = {stream.index: stream for stream in streams}
    for other in set(container.streams) - set(wanted.values()):
        other.discard = Discard.all
    failures = 0
    while failures < _MAX_FAILURES:
        try:
            for packet in container.demux(*wanted.values()):
                failures = 0
                if packet.size:  # an empty one would end the decoder
                    yield packet
            return
        except IndexError:  # PyAV's, at the end, if a stream appeared during the reading
            return
        except av.FFmpegError:
            failures += 1
            if failures == 1:
                on_error()


_DEFAULT_RATE = Fraction(25)
_BT709 = ColorTags(1, 1, 1)
_APPLE_LOCATION = "com.apple.quicktime.location.iso6709"
_MAX_TERM = 1_000_000  # of a rate as a fraction; the encoder has 32-bit integers


def picture_stream(container: InputContainer, path: Path) -> VideoStream:
    """Return the first stream of moving pictures, which is not a cover or a thumbnail.

    Raises
    ------
    VideoError
        There is none, or no decoder for it.
    """
    for stream in moving_streams(container):
        if stream.codec_context is None:
            raise VideoError(f"{path}: its codec is not known here; convert it to H.264 first")
        return stream
    raise VideoError(f"{path}: has no moving pictures; give a video file")


def moving_streams(container: InputContainer) -> list[VideoStream]:
    """Return the streams of moving pictures: not those of a cover or of thumbnails."""
    stills = Disposition.attached_pic | Disposition.timed_thumbnails
    return [stream for stream in container.streams.video if not stream.disposition & stills]


def check_size(path: Path, width: int, height: int) -> None:
    """Refuse frames that are too large, before memory is set aside. Raises `VideoError`."""
    if max(width, height) > MAX_SIDE or width * height > MAX_PIXELS:
        raise VideoError(
            f"{path}: frames of {width}×{height} pixels are too large ({MAX_PIXELS // 10**6} "
            f"million pixels and sides of {MAX_SIDE} at most); scale it down first"
        )


def _orientation(path: Path, first: av.VideoFrame) -> Orientation:
    if sequence := find_sequence(path):
        with suppress(ImageError):  # of a format that only FFmpeg reads
            return read_header(Path(sequence.pattern % sequence.first))[1]
    return Orientation.of_frame(first)


def describe(
    path: Path, container: InputContainer, stream: VideoStream, first: av.VideoFrame
) -> VideoInfo:
    """Describe a video, of which the `first` picture has been decoded."""
    time_base = _time_base(stream)
    rate = _first_sensible(stream.average_rate, stream.guessed_rate)
    start = (first.pts or 0) * time_base
    # The longest stream may be longer than the picture.
    longest = Fraction(container.duration, av.time_base) if container.duration else None
    duration = stated_duration(stream, start) or longest
    turn = _orientation(path, first)
    is_hdr = first.color_trc in HDR_TRANSFERS
    colors = ColorTags(first.color_primaries, first.color_trc, first.colorspace)
    width, height, aspect = first.width, first.height, stream.sample_aspect_ratio or Fraction(1)
    if turn.is_sideways:
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
        orientation=turn,
        pixel_aspect=aspect,
        color=_BT709 if is_hdr else colors,
        coding=(not is_hdr and turn == Orientation() and Coding.of(first)) or Coding(),
        has_sound=bool(container.streams.audio),
        tags=_tags(container, stream),
    )


def _tags(container: InputContainer, stream: VideoStream) -> Tags:
    """Return metadata of the recording; their names differ between containers."""
    found = {
        name.lower(): value
        for metadata in (stream.metadata, container.metadata)
        for name, value in metadata.items()
    }
    location = found.get("location") or found.get(_APPLE_LOCATION)
    return Tags(found.get("creation_time"), location, found.get("title"))


def stated_duration(stream: VideoStream, start: Fraction) -> Fraction | None:
    """Return the time from the first frame to the end of the stream, as the file declares it.

    In seconds; None where it declares none. `start` is the time of the first frame. In MP4, frames
    may be hidden before it. Matroska, in a tag, and ASF declare the time of the end.
    """
    form, unit = stream.container.format.name, _time_base(stream)
    if stream.duration and form == "asf":
        return stream.duration * unit - start
    if stream.duration and form.startswith("mov"):
        return ((stream.start_time or 0) + stream.duration) * unit - start
    if stream.duration:
        return stream.duration * unit
    try:
        hours, minutes, seconds = stream.metadata["DURATION"].split(":")
        end = Fraction(hours) * 3600 + Fraction(minutes) * 60 + Fraction(seconds)
    except (KeyError, ValueError, ZeroDivisionError):
        return None
    return end - start if end > start else None


def period_of(stream: VideoStream) -> Fraction:
    """Return the usual time from one picture to the next, in units of the time base.

    The average is longer where pictures are missing.
    """
    rate = _first_sensible(stream.guessed_rate, stream.average_rate)
    return 1 / (rate * _time_base(stream))


def _time_base(stream: VideoStream) -> Fraction:
    return stream.time_base or Fraction(1, 90_000)


def _first_sensible(*rates: Fraction | None) -> Fraction:
    for rate in rates:
        if rate and (near := rate.limit_denominator(_MAX_TERM)) > 0:
            return near
    return _DEFAULT_RATE

"""What a video file declares: its size, rate, length, colours."""

from contextlib import suppress
from fractions import Fraction
from pathlib import Path

import av
from av.container import InputContainer
from av.stream import Disposition
from av.video.stream import VideoStream

from vdet.errors import ImageError, VideoError
from vdet.media.coding import HDR_TRANSFERS, Coding
from vdet.media.demux import MAX_PIXELS, MAX_SIDE
from vdet.media.frame import ColorTags, Tags, VideoInfo
from vdet.media.images import Orientation, read_header
from vdet.media.numbered import find_sequence

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
            return read_header(sequence.first_picture)[1]
    return Orientation.of_frame(first)


def describe(
    path: Path, container: InputContainer, stream: VideoStream, first: av.VideoFrame
) -> VideoInfo:
    """Describe a video, of which the `first` picture has been decoded."""
    time_base = _time_base(stream)
    rate = _first_sensible(stream.average_rate, stream.guessed_rate)
    start = (first.pts or 0) * time_base
    duration = stated_duration(stream, start) or _longest(container)
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
    """Return what a file says of the recording, in the words of any container."""
    found = {
        name.lower(): value
        for metadata in (stream.metadata, container.metadata)
        for name, value in metadata.items()
    }
    location = found.get("location") or found.get(_APPLE_LOCATION)
    return Tags(found.get("creation_time"), location, found.get("title"))


def stated_duration(stream: VideoStream, start: Fraction) -> Fraction | None:
    """Return the duration of the picture stream that the file declares, seconds, or None.

    Matroska declares, in a tag, the end of the stream; `start` is the time of its first frame.
    """
    if stream.duration and stream.time_base:
        return stream.duration * stream.time_base
    try:
        hours, minutes, seconds = stream.metadata["DURATION"].split(":")
        end = Fraction(hours) * 3600 + Fraction(minutes) * 60 + Fraction(seconds)
    except (KeyError, ValueError, ZeroDivisionError):
        return None
    return end - start if end > start else None


def _longest(container: InputContainer) -> Fraction | None:
    """Return the duration of the longest stream, seconds; that of the picture may be shorter."""
    return Fraction(container.duration, av.time_base) if container.duration else None


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

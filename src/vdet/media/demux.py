"""Open a video file, and read its packets in spite of damage."""

import os
import re
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path

import av
from av.container import InputContainer
from av.packet import Packet
from av.stream import Stream

from vdet.errors import VideoError
from vdet.media.images import PICTURE_SUFFIXES
from vdet.media.mp4_index import check_mp4_index, first_bytes
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


def open_input(path: Path, frame_rate: float | None = None) -> InputContainer:
    """Open a video file, or numbered pictures (`img_%04d.png`, or a folder), for reading.

    Parameters
    ----------
    frame_rate
        Of numbered pictures, per second; None: `ASSUMED_RATE`.

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
        check_mp4_index(path)
        if _is_raw_mjpeg(path):
            kind = "mjpeg"  # FFmpeg may take it for a pipe of pictures, which is not read
    try:
        options["max_pixels"] = str(MAX_PIXELS)  # the file is probed with decoders
        return av.open(name, "r", kind, options, metadata_errors="replace")  # tags: any encoding
    except (av.PermissionError, av.error.MemoryError) as error:
        raise VideoError(f"{path}: cannot be opened: {error.strerror}") from error
    except av.FFmpegError as error:
        raise VideoError(
            f"{path}: is not a video, or one that was cut off while it was recorded "
            f"({error.strerror}); give a file that plays"
        ) from error


def refuse_stream(path: Path) -> None:
    """Refuse what is no file: an address, or ``-``. Raises `VideoError`."""
    if path.exists():
        return
    if _ADDRESS.match(str(path)):
        raise VideoError(f"{path}: streams are not read; record it into a file first")
    if path == Path("-"):
        raise VideoError("-: standard input is not read; give the name of a file")


def is_pipe(path: Path) -> bool:
    """Return whether what is read from `path` can be read only once, as from a FIFO."""
    return path.exists() and not path.is_file() and not path.is_dir()


def _is_raw_mjpeg(path: Path) -> bool:
    """Return whether a file begins with a JPEG picture, and is not named as a single one."""
    is_jpeg = path.is_file() and first_bytes(path).startswith(b"\xff\xd8\xff")
    return is_jpeg and path.suffix.lower() not in PICTURE_SUFFIXES


def packets(
    container: InputContainer, *streams: Stream, on_error: Callable[[], None]
) -> "Iterator[Packet[Stream]]":
    """Yield the packets of `streams` in file order; skip what cannot be read.

    `on_error` is called at each place where something had to be skipped.
    """
    failures = 0
    while failures < _MAX_FAILURES:
        try:
            for packet in container.demux(list(streams)):
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

"""Open a video file, and take its packets out in spite of damage."""

from collections.abc import Callable, Iterator
from pathlib import Path

import av
from av.container import InputContainer
from av.packet import Packet
from av.stream import Stream

from vdet.errors import VideoError

_MAX_FAILURES = 100  # in a row; a file that gives nothing but errors must end, too


def open_input(path: Path) -> InputContainer:
    """Open a video file for reading.

    Raises
    ------
    VideoError
        There is no such file, it cannot be read, or it is not a video.
    """
    if path.is_dir():
        raise VideoError(f"{path}: is a folder; give the name of a video file")
    try:
        # An absolute name cannot be taken for a protocol ("a:b.mp4"); tags need not be UTF-8.
        return av.open(str(path.absolute()), mode="r", metadata_errors="replace")
    except av.FileNotFoundError as error:
        raise VideoError(f"{path}: there is no such file; check the name") from error
    except av.PermissionError as error:
        raise VideoError(f"{path}: may not be read; check its permissions") from error
    except av.FFmpegError as error:
        raise VideoError(
            f"{path}: is not a video, or one that was cut off while it was recorded "
            f"({error.strerror}); give a file that plays"
        ) from error


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
                if packet.size:  # an empty one would tell the decoder that all is over
                    yield packet
            return
        except av.FFmpegError:
            failures += 1
            if failures == 1:
                on_error()

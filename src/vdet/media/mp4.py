"""What the boxes of an MP4 or MOV file say before FFmpeg reads them (ISO/IEC 14496-12)."""

from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path

from vdet.errors import VideoError

_MAX_SAMPLES = 4_000_000  # always accepted: 44 hours of video
_MAX_BOXES = 200_000  # that are read; ten hours of one-second fragments have as many
_HEAD = 24  # bytes of a box
_PARENTS = {b"moov", b"trak", b"mdia", b"minf", b"stbl", b"moof", b"traf"}
_FIRST = {
    *(b"ftyp", b"styp", b"moov", b"moof", b"mdat"),
    *(b"free", b"skip", b"wide", b"sidx", b"uuid"),
}
_OWN_FIELDS = 0xF00  # flags of a track run: each sample has fields of its own in the file


def is_mp4(path: Path) -> bool:
    """Return whether a file begins like an MP4 or MOV file."""
    return first_bytes(path)[4:] in _FIRST


def first_bytes(path: Path) -> bytes:
    """Return the first 8 bytes of a file; none where it cannot be read, or only once."""
    with suppress(OSError):
        if path.is_file():
            with path.open("rb") as file:
                return file.read(8)
    return b""


def joined_videos(path: Path) -> int:
    """Return how many videos, each with an index, were joined byte by byte to one file."""
    return sum(kind == b"moov" for kind, _ in _boxes(path))


def check_index(path: Path) -> None:
    """Refuse a file that claims far more samples than it has bytes.

    An index can claim any number of samples of one size in a few bytes, and the demultiplexer makes
    an entry for each: a file of 5 kB can ask for gigabytes of memory.

    Raises
    ------
    VideoError
        It does. A file that cannot be read, or is of another kind, passes.
    """
    claimed = sum(_claim(kind, head) for kind, head in _boxes(path))
    if claimed > _MAX_SAMPLES and claimed > (size := path.stat().st_size):
        raise VideoError(f"{path}: is damaged: {claimed:,} samples in {size:,} bytes")


def _boxes(path: Path) -> Iterator[tuple[bytes, bytes]]:
    """Yield the kind and the first bytes of each box, down to the tables of samples."""
    return islice(_walk(path), _MAX_BOXES) if is_mp4(path) else iter(())


def _walk(path: Path) -> Iterator[tuple[bytes, bytes]]:
    position, size = 0, path.stat().st_size
    with path.open("rb") as file:
        while position + 8 <= size:
            file.seek(position)
            head = file.read(_HEAD)
            length, kind, inside = int.from_bytes(head[:4]), head[4:8], 8
            if length == 1:  # it follows, in 64 bits
                length, inside = int.from_bytes(head[8:16]), 16
            yield kind, head
            if kind not in _PARENTS and length < inside:  # 0: to the end of the file; else damaged
                return
            position += inside if kind in _PARENTS else length


def _claim(kind: bytes, head: bytes) -> int:
    """Return how many samples a box claims without an entry for each."""
    if kind == b"stsz" and any(head[12:16]):  # all of one size
        return int.from_bytes(head[16:20])
    if kind == b"trun" and not int.from_bytes(head[9:12]) & _OWN_FIELDS:
        return int.from_bytes(head[12:16])
    return 0

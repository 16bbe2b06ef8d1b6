"""The number of samples that the index of an MP4 or MOV file claims, checked before it is read.

An index can claim any number of samples of one size in a few bytes, and the demultiplexer makes an
entry for each: a file of 5 kB can ask for gigabytes of memory.
"""

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import BinaryIO

from vdet.errors import VideoError

_MAX_SAMPLES = 4_000_000  # always accepted: 44 hours of video
_MAX_BOXES = 200_000  # that are read; ten hours of one-second fragments have as many

_PARENTS = {b"moov", b"trak", b"mdia", b"minf", b"stbl", b"moof", b"traf"}
_FIRST_BOXES = {
    *(b"ftyp", b"styp", b"moov", b"moof", b"mdat"),
    *(b"free", b"skip", b"wide", b"sidx", b"uuid"),
}
_OWN_FIELDS = 0xF00  # flags of a track run: each sample has fields of its own in the file


def check_mp4_index(path: Path) -> None:
    """Refuse an MP4 or MOV file that claims far more samples than it has bytes.

    Raises
    ------
    VideoError
        It does. A file that cannot be read passes: `open_input` refuses it.
    """
    if not path.is_file():  # reading from a pipe would consume its content
        return
    try:
        with path.open("rb") as file:
            size = file.seek(0, 2)
            claimed = sum(islice(_claims(file, size), _MAX_BOXES))
    except OSError:
        return
    if claimed > max(_MAX_SAMPLES, size):
        raise VideoError(
            f"{path}: claims {claimed:,} samples in {size:,} bytes, so it is damaged; "
            "give a file that plays"
        )


def begins_like_mp4(path: Path) -> bool:
    """Return whether the first bytes of a file are those of an MP4 or MOV file."""
    return first_bytes(path)[4:] in _FIRST_BOXES


def first_bytes(path: Path) -> bytes:
    """Return the first 8 bytes of a file; none where it cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(8)
    except OSError:
        return b""


def _claims(file: BinaryIO, size: int) -> Iterator[int]:
    """Yield the number of samples of one size that each box claims."""
    position = 0
    while position + 8 <= size:
        file.seek(position)
        head = file.read(24)
        length, kind, inside = int.from_bytes(head[:4]), head[4:8], 8
        if position == 0 and kind not in _FIRST_BOXES:
            return
        if length == 1:
            length, inside = int.from_bytes(head[8:16]), 16
        yield _claim(kind, head)
        if kind not in _PARENTS and length < inside:  # 0: to the end of the file; else damaged
            return
        position += inside if kind in _PARENTS else length


def _claim(kind: bytes, head: bytes) -> int:
    if kind == b"stsz" and len(head) >= 20 and any(head[12:16]):
        return int.from_bytes(head[16:20])
    if kind == b"trun" and len(head) >= 16 and not int.from_bytes(head[9:12]) & _OWN_FIELDS:
        return int.from_bytes(head[12:16])
    return 0

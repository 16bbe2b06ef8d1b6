"""An index that claims more samples than a file can have is refused before it costs memory."""

import struct
from pathlib import Path

import pytest

from clips import write_clip
from vdet.errors import VideoError
from vdet.media.mp4 import check_index
from vdet.media.reader import VideoReader

MANY = 90_000_000


def box(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I4s", 8 + len(content), kind) + content


def with_claim(path: Path, count: int, size: int = 1) -> Path:
    """Make the sample table claim `count` samples of `size` bytes."""
    data = bytearray(path.read_bytes())
    at = data.index(b"stsz")
    data[at + 8 : at + 16] = struct.pack(">II", size, count)
    path.write_bytes(data)
    return path


def test_more_samples_than_bytes_are_refused(tmp_path: Path) -> None:
    path = with_claim(write_clip(tmp_path / "bomb.mp4"), MANY)
    with pytest.raises(
        VideoError, match=r"bomb\.mp4: is damaged: 90,000,000 samples in \d,\d+ bytes"
    ):
        VideoReader(path)


@pytest.mark.parametrize("parts", [1, 30])
def test_fragments_that_claim_too_many_samples_together_are_refused(
    parts: int, tmp_path: Path
) -> None:
    run = box(b"trun", struct.pack(">III", 1, MANY // parts, 0))
    data = box(b"ftyp", b"isom") + box(b"moof", box(b"traf", run)) * parts
    (tmp_path / "bomb.mp4").write_bytes(data)
    with pytest.raises(VideoError, match="is damaged: 90,000,000 samples"):
        check_index(tmp_path / "bomb.mp4")


def test_an_index_after_a_box_with_a_64_bit_size_is_checked(tmp_path: Path) -> None:
    large = struct.pack(">I4sQ", 1, b"mdat", 16 + 5000) + bytes(5000)
    table = box(b"moov", box(b"trak", box(b"stsz", struct.pack(">III", 0, 1, MANY))))
    (tmp_path / "bomb.mov").write_bytes(large + table)
    with pytest.raises(VideoError, match="is damaged: 90,000,000"):
        check_index(tmp_path / "bomb.mov")


def test_whole_clips_pass(tmp_path: Path) -> None:
    for suffix, options in (
        ("mp4", {"sounds": ["aac"]}),
        ("mov", {"sounds": ["pcm_s16le"], "sound_seconds": 100, "count": 2}),
        ("mp4", {"movflags": "+frag_keyframe+empty_moov"}),
        ("mkv", {}),
    ):
        check_index(write_clip(tmp_path / f"clip.{suffix}", **options))

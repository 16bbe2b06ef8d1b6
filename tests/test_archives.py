"""Zip files from outside: listed and read, up to their limits."""

import io
import struct
import tracemalloc
import zipfile

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.archives import ArchiveError, open_archive, read_member


def zipped(name: str, data: bytes, compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", compression) as archive:
        archive.writestr(name, data)
    return file.getvalue()


def member(data: bytes, name: str = "a", limit: int = 10**9) -> bytes:
    with open_archive(io.BytesIO(data)) as archive:
        return read_member(archive, name, limit=limit)


@given(st.binary(), st.sampled_from([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED]))
def test_a_member_is_read_as_it_was_written(data: bytes, compression: int) -> None:
    assert member(zipped("a", data, compression)) == data


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (zipped("a", bytes(101)), "its member a is larger than 100 bytes"),
        (zipped("a", b"x", zipfile.ZIP_BZIP2), "its member a is compressed in an unusual way"),
        (zipped("a", b"x", zipfile.ZIP_LZMA), "its member a is compressed in an unusual way"),
        (zipped("b", b"x"), "its member a is damaged or missing"),
        (b"no zip file", "is not a folder or a readable zip file"),
    ],
)
def test_the_error_says_why_a_member_is_not_read(data: bytes, words: str) -> None:
    with pytest.raises(ArchiveError, match=words):
        member(data, limit=100)


def test_a_member_is_unpacked_no_further_than_it_claims_to_go() -> None:
    data = bytearray(zipped("a", bytes(100_000_000)))
    struct.pack_into("<I", data, 22, 1000)
    struct.pack_into("<I", data, data.find(b"PK\x01\x02") + 24, 1000)
    tracemalloc.start()
    with pytest.raises(ArchiveError, match="its member a is damaged"):
        member(bytes(data))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2_000_000

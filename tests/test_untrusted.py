"""Files from outside: limits, zip files, names."""

import contextlib
import io
import struct
import tracemalloc
import zipfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.archives import ArchiveError, list_members, open_archive, read_member
from vdet.errors import ConfigError
from vdet.files import printable, read_whole


def read(path: Path, most: int) -> bytes:
    return read_whole(path, most=most, what="letter", error=ConfigError)


@pytest.mark.parametrize("size", [0, 9, 10])
def test_a_file_within_its_limit_is_read_whole(tmp_path: Path, size: int) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"x" * size)
    assert read(path, 10) == b"x" * size


def test_a_larger_file_is_refused_in_the_callers_own_kind_of_error(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"x" * 1001)
    with pytest.raises(ConfigError, match=r"file: is larger than 1,000 bytes; that is no letter"):
        read(path, 1000)


def test_a_file_without_an_end_takes_no_more_memory_than_its_limit() -> None:
    tracemalloc.start()
    with pytest.raises(ConfigError, match="/dev/zero: is larger than 3,000,000 bytes"):
        read(Path("/dev/zero"), 3_000_000)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 7_500_000


def test_no_memory_is_set_aside_for_a_limit_that_is_not_reached(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"x")
    tracemalloc.start()
    read(path, 10**9)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2_000_000


def test_a_missing_file_is_named() -> None:
    with pytest.raises(ConfigError, match="none: cannot be read: No such file"):
        read(Path("none"), 10)


def zipped(name: str, data: bytes, compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", compression) as archive:
        archive.writestr(name, data)
    return file.getvalue()


def member(data: bytes, name: str = "a", most: int = 10**9) -> bytes:
    with open_archive(io.BytesIO(data)) as archive:
        return read_member(archive, name, most=most)


@given(st.binary(), st.sampled_from([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED]))
def test_a_member_is_read_as_it_was_written(data: bytes, compression: int) -> None:
    assert member(zipped("a", data, compression)) == data


@given(st.binary(min_size=30, max_size=200), st.data())
def test_a_member_is_read_whole_or_not_at_all(content: bytes, drawn: st.DataObject) -> None:
    data = bytearray(zipped("a", content))
    data[drawn.draw(st.integers(0, len(data) - 1))] ^= drawn.draw(st.integers(1, 255))
    with contextlib.suppress(ArchiveError):
        assert member(bytes(data)) == content


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (zipped("a", bytes(101)), "its member a is larger than 100 bytes"),
        (zipped("a", b"x", zipfile.ZIP_BZIP2), "its member a is compressed in an unusual way"),
        (zipped("a", b"x", zipfile.ZIP_LZMA), "its member a is compressed in an unusual way"),
        (zipped("b", b"x"), "its member a is damaged or missing"),
        (b"no zip file", "is neither a folder nor a readable zip file"),
    ],
)
def test_what_is_not_read_is_said_to_be(data: bytes, words: str) -> None:
    with pytest.raises(ArchiveError, match=words):
        member(data, most=100)


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


@pytest.mark.parametrize("name", ["a", "a/b..c", "...", "a/.b/c", "12:30.png", "C/a", "~/a", "é"])
def test_ordinary_names_are_listed(tmp_path: Path, name: str) -> None:
    path = tmp_path / "a.zip"
    path.write_bytes(zipped(name, b""))
    assert list_members(path) == [name]


@given(st.text(max_size=200))
def test_a_name_is_shown_on_one_line_that_a_terminal_only_shows(name: str) -> None:
    shown = printable(name)
    assert shown.isprintable()
    assert len(shown) <= 81
    assert shown == name or not name.isprintable() or name.startswith(shown[:-1])

from pathlib import Path

import pytest

from vdet.errors import TruthError
from vdet.labels.parsing import numbered_lines, parse_number


def test_blank_lines_count() -> None:
    assert list(numbered_lines(Path("a"), b"a\r\n\r\n b \nc")) == [(1, "a"), (3, "b"), (4, "c")]


@pytest.mark.parametrize(
    "text", ["", "nan", "inf", "-inf", "0x1", "1,5", "car", "1 2", "10000001", "-1e300", "9" * 5000]
)
def test_what_is_not_a_number_or_beyond_the_limit_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="is not a number of at most 10000000"):
        parse_number(text)


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", bytes(range(256))])
def test_a_file_that_is_not_text_is_refused(content: bytes) -> None:
    with pytest.raises(TruthError, match="gt: is not text"):
        list(numbered_lines(Path("gt"), content))


def test_a_byte_order_mark_is_not_part_of_the_text() -> None:
    assert list(numbered_lines(Path("gt"), b"\xef\xbb\xbf1,2")) == [(1, "1,2")]

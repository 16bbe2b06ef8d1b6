from pathlib import Path

import pytest

from vdet.errors import TruthError
from vdet.labels.parsing import numbered_lines, parse_number


def test_blank_lines_count_and_any_line_ending_is_read() -> None:
    assert list(numbered_lines(Path("a"), b"a\r\n\r\n b \rc\n")) == [(1, "a"), (3, "b"), (4, "c")]


@pytest.mark.parametrize(
    ("text", "value"), [("3", 3), (" -2.5 ", -2.5), (".5", 0.5), ("1e3", 1000), ("+7.", 7)]
)
def test_a_decimal_number_is_read(text: str, value: float) -> None:
    assert parse_number(text) == value


@pytest.mark.parametrize("text", ["", "nan", "inf", "-inf", "1_0", "0x1", "1,5", "٣", "car", "1 2"])
def test_text_that_is_no_decimal_number_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="is not a number"):
        parse_number(text)


@pytest.mark.parametrize("text", ["10000001", "-1e300", "9" * 5000])
def test_a_number_beyond_the_limit_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="is beyond 10000000"):
        parse_number(text)


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"1,2\x003", bytes(range(256))])
def test_a_file_that_is_not_text_is_refused(content: bytes) -> None:
    with pytest.raises(TruthError, match="gt: is not text"):
        list(numbered_lines(Path("gt"), content))


def test_a_byte_order_mark_is_not_part_of_the_text() -> None:
    assert list(numbered_lines(Path("gt"), b"\xef\xbb\xbf1,2")) == [(1, "1,2")]

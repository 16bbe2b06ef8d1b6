import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vdet.features import resize
from vdet.search.pyramid import FramePyramid

FRAME = np.random.default_rng(0).integers(0, 256, (97, 131, 3), dtype=np.uint8)


def spans(length: int) -> st.SearchStrategy[slice]:
    pairs = st.tuples(st.integers(0, length - 1), st.integers(1, length))
    return pairs.map(lambda pair: slice(pair[0], min(length, sum(pair))))


@given(spans(97), spans(131), st.integers(1, 60), st.integers(1, 60), st.integers(0, 96))
def test_a_cut_is_the_resized_crop(
    rows: slice, columns: slice, width: int, height: int, top: int
) -> None:
    frame = FramePyramid(FRAME, min(top, rows.start))
    expected = resize(FRAME[rows, columns], width, height)
    np.testing.assert_array_equal(frame.cut(rows, columns, width, height), expected)


@given(
    st.sampled_from([0, 1, 2, 3, 4, 8, 16]),
    st.sampled_from([0, 1, 2, 3, 4, 8, 16]),
    st.sampled_from([1, 2, 4, 8]),
    st.sampled_from([2, 3, 4]),
)
def test_a_cut_that_can_be_halved_is_so_from_odd_and_from_even_pixels(
    top: int, left: int, factor: int, side: int
) -> None:
    rows = slice(top, top + factor * side * 2)
    columns = slice(left, left + factor * side * 3)
    cut = FramePyramid(FRAME).cut(rows, columns, side * 3, side * 2)
    np.testing.assert_array_equal(cut, resize(FRAME[rows, columns], side * 3, side * 2))
    means = FRAME[rows, columns].reshape(side * 2, factor, side * 3, factor, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(cut, means, atol=np.log2(factor) / 2)  # each halving rounds


def test_cuts_do_not_depend_on_what_was_cut_before() -> None:
    one = FramePyramid(FRAME)
    places = [(slice(0, 64), slice(0, 128)), (slice(8, 72), slice(4, 68)), (slice(1, 65),) * 2]
    for rows, columns in [*places, *places[::-1]]:
        for side in (8, 16, 32, 64):
            fresh = FramePyramid(FRAME).cut(rows, columns, side, side)
            np.testing.assert_array_equal(one.cut(rows, columns, side, side), fresh)


def test_rows_that_nobody_asks_for_are_never_looked_at() -> None:
    other = np.array(FRAME)
    other[:32] = other[80:] = 0
    rows, columns = slice(40, 72), slice(0, 64)
    first = FramePyramid(FRAME, 32, 80).cut(rows, columns, 16, 8)
    second = FramePyramid(other, 32, 80).cut(rows, columns, 16, 8)
    np.testing.assert_array_equal(first, second)


def test_the_frame_itself_is_there_whole_and_untouched() -> None:
    image = FRAME.copy()
    frame = FramePyramid(image, 16, 80)
    frame.cut(slice(16, 80), slice(0, 64), 8, 8)
    assert frame.image is image
    np.testing.assert_array_equal(image, FRAME)

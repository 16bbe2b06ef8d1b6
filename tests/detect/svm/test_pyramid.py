import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vdet.detect.svm.features import resize
from vdet.detect.svm.pyramid import FramePyramid

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
def test_a_cut_of_halvable_size_is_halved_from_odd_and_even_pixels(
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


def test_pixels_outside_the_searched_rows_do_not_matter() -> None:
    other = np.array(FRAME)
    other[:32] = other[80:] = 0
    rows, columns = slice(40, 72), slice(0, 64)
    first = FramePyramid(FRAME, 32, 80).cut(rows, columns, 16, 8)
    second = FramePyramid(other, 32, 80).cut(rows, columns, 16, 8)
    np.testing.assert_array_equal(first, second)


def test_the_frame_is_not_changed() -> None:
    image = FRAME.copy()
    frame = FramePyramid(image, 16, 80, margin=16)
    frame.cut(slice(16, 80), slice(-16, 48), 8, 8)
    np.testing.assert_array_equal(image, FRAME)


@given(spans(97), spans(131), st.integers(0, 96))
def test_a_crop_is_a_window_of_the_frame_at_full_size(
    rows: slice, columns: slice, top: int
) -> None:
    frame = FramePyramid(FRAME, min(top, rows.start))
    size = columns.stop - columns.start, rows.stop - rows.start
    crop = frame.crop(columns.start, rows.start, *size)
    np.testing.assert_array_equal(crop, FRAME[rows, columns])


MARGIN = 48
BEYOND = np.pad(FRAME, ((0, 0), (MARGIN, MARGIN), (0, 0)), mode="edge")


@given(spans(97), spans(131 + 2 * MARGIN), st.integers(0, 96), st.integers(1, 40))
def test_beyond_the_sides_the_outermost_columns_repeat(
    rows: slice, columns: slice, top: int, side: int
) -> None:
    frame = FramePyramid(FRAME, min(top, rows.start), margin=MARGIN)
    expected = BEYOND[rows, columns]
    left, height = columns.start - MARGIN, rows.stop - rows.start
    crop = frame.crop(left, rows.start, columns.stop - columns.start, height)
    np.testing.assert_array_equal(crop, expected)
    cut = frame.cut(rows, slice(left, columns.stop - MARGIN), side, side)
    np.testing.assert_array_equal(cut, resize(expected, side, side))


def test_inside_the_frame_a_margin_changes_nothing() -> None:
    rows, columns = slice(8, 72), slice(16, 80)
    plain, wide = FramePyramid(FRAME), FramePyramid(FRAME, margin=16)
    for side in (8, 16, 20, 64):
        np.testing.assert_array_equal(
            wide.cut(rows, columns, side, side), plain.cut(rows, columns, side, side)
        )

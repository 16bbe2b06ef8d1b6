import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vdet.config.kinds import FeatureSettings
from vdet.detect.svm.model import resize, split
from vdet.detect.svm.search import FramePyramid
from vdet.detect.svm.windows import FrameStrip
from vdet.media import Picture

FEATURES = FeatureSettings(halved=())
FRAME = np.random.default_rng(0).integers(0, 256, (97, 131, 3), dtype=np.uint8)


def spans(length: int) -> st.SearchStrategy[slice]:
    pairs = st.tuples(st.integers(0, length - 1), st.integers(1, length))
    return pairs.map(lambda pair: slice(pair[0], min(length, sum(pair))))


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
    cut = FramePyramid(Picture(FRAME), FEATURES).cut(FrameStrip(rows, columns, side * 3, side * 2))
    means = FRAME[rows, columns].reshape(side * 2, factor, side * 3, factor, 3).mean(axis=(1, 3))
    expected = np.array(split(means.round().astype(np.uint8), FEATURES), int)
    np.testing.assert_allclose(cut, expected, atol=2 + np.log2(factor) / 2)  # each halving rounds


MARGIN = 48
BEYOND = np.pad(FRAME, ((0, 0), (MARGIN, MARGIN), (0, 0)), mode="edge")


@given(spans(97), spans(131 + 2 * MARGIN), st.integers(0, 96), st.integers(1, 40))
def test_beyond_the_sides_the_outermost_columns_repeat(
    rows: slice, columns: slice, top: int, side: int
) -> None:
    frame = FramePyramid(Picture(FRAME), FEATURES, min(top, rows.start), margin=MARGIN)
    expected = BEYOND[rows, columns]
    of_frame = slice(columns.start - MARGIN, columns.stop - MARGIN)
    height, width, _ = expected.shape
    window = frame.cut(FrameStrip(rows, of_frame, width, height))
    np.testing.assert_array_equal(window, split(expected, FEATURES))
    cut = frame.cut(FrameStrip(rows, of_frame, side, side))
    as_in_training = split(resize(expected, side, side), FEATURES)
    np.testing.assert_array_equal(cut, as_in_training)

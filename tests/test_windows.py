import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from vdet.config.schema import Settings, WindowSettings
from vdet.windows import Windows, positions

LARGE, SMALL = Settings().search.windows


def band(size: int, overlap: float, top: int, bottom: int) -> WindowSettings:
    return WindowSettings(size=size, overlap=overlap, top=top, bottom=bottom)


def test_the_default_sets_have_423_and_408_windows_on_a_720p_frame() -> None:
    assert len(positions(LARGE, 1280)) == 423
    assert len(positions(SMALL, 1280)) == 408


def test_the_large_set_lies_in_47_columns_and_9_rows() -> None:
    x, y = positions(LARGE, 1280)[:, :2].T
    assert np.unique(x).tolist() == list(range(0, 47 * 25, 25))
    assert np.unique(y).tolist() == list(range(380, 380 + 9 * 25, 25))


def test_the_small_set_lies_in_102_columns_and_4_rows() -> None:
    x, y = positions(SMALL, 1280)[:, :2].T
    assert np.unique(x).tolist() == list(range(0, 102 * 12, 12))
    assert np.unique(y).tolist() == [400, 412, 424, 436]


def test_windows_are_laid_row_by_row_from_the_top_left() -> None:
    boxes = positions(band(10, 0.5, 7, 22), 20)
    expected = [[0, 7], [5, 7], [10, 7], [0, 12], [5, 12], [10, 12]]
    assert boxes.tolist() == [[x, y, 10, 10] for x, y in expected]
    assert boxes.dtype == np.int32


def test_without_overlap_windows_tile_the_band() -> None:
    assert positions(band(10, 0, 0, 20), 30)[:, :2].tolist() == [
        [0, 0], [10, 0], [20, 0], [0, 10], [10, 10], [20, 10],
    ]  # fmt: skip


def test_step_and_buffer_are_truncated() -> None:
    # size 20, overlap 0.33: step int(13.4) = 13, buffer int(6.6) = 6, columns (100 - 6) // 13 = 7
    assert positions(band(20, 0.33, 0, 20), 100)[:, 0].tolist() == [0, 13, 26, 39, 52, 65, 78]


def test_a_frame_narrower_than_a_window_has_none() -> None:
    boxes = positions(band(64, 0.5, 0, 64), 63)
    assert boxes.shape == (0, 4)
    assert boxes.dtype == np.int32


def test_a_band_lower_than_a_window_has_none() -> None:
    low = band(64, 0.5, 0, 64).model_copy(update={"bottom": 63})  # as scaling may leave it
    assert positions(low, 640).shape == (0, 4)


def test_a_window_scaled_down_to_nothing_is_not_laid() -> None:
    nothing = band(64, 0.5, 0, 64).model_copy(update={"size": 0})
    assert positions(nothing, 640).shape == (0, 4)


def test_a_last_window_that_would_stick_out_by_a_pixel_is_left_out() -> None:
    # step 25 and buffer 102 are together a pixel short of 128, so 47 windows would end at 1278
    boxes = positions(LARGE, 1277)
    assert (boxes[:, 0] + boxes[:, 2]).max() == 1253


@given(
    st.integers(8, 200),
    st.floats(0, 0.99),
    st.integers(0, 300),
    st.integers(0, 400),
    st.integers(1, 900),
)
def test_all_windows_lie_inside_band_and_frame(
    size: int, overlap: float, top: int, spare: int, width: int
) -> None:
    assume(int(size * (1 - overlap)) >= 1)
    settings = band(size, overlap, top, top + size + spare)
    x, y, w, h = positions(settings, width).T
    assert (x >= 0).all()
    assert (x + w <= width).all()
    assert (y >= top).all()
    assert (y + h <= settings.bottom).all()
    assert ((w == size) & (h == size)).all()


@given(st.integers(8, 200), st.floats(0, 0.95), st.integers(0, 300))
def test_any_frame_that_can_hold_a_window_has_one_at_its_left(
    size: int, overlap: float, spare: int
) -> None:
    assume(int(size * (1 - overlap)) >= 1)
    boxes = positions(band(size, overlap, 0, size), size + spare)
    assert len(boxes) >= 1
    assert boxes[0].tolist() == [0, 0, size, size]


def test_detected_keeps_windows_of_at_least_the_probability_in_order() -> None:
    boxes = np.arange(16, dtype=np.int32).reshape(4, 4)
    windows = Windows(boxes, np.array([0.5, 0.25, 0.75, 0.499], np.float32))
    found = windows.detected(0.5)
    assert found.boxes.tolist() == [[0, 1, 2, 3], [8, 9, 10, 11]]
    assert found.probabilities.tolist() == [0.5, 0.75]
    assert len(windows) == 4
    assert len(found) == 2

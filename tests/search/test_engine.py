import numpy as np
import pytest

from vdet.config.scaling import scale_lengths
from vdet.config.schema import (
    FeatureSettings,
    HistogramSettings,
    HogSettings,
    SearchSettings,
    Settings,
    WindowSettings,
)
from vdet.errors import ImageError
from vdet.model import LinearModel
from vdet.search.engine import lay_windows, make_search

COLOUR = FeatureSettings(hog=HogSettings(channels=()), histogram=HistogramSettings(bins=8))
MODEL = LinearModel(COLOUR, np.zeros((1, 24), np.float32), *np.zeros((3, 1), np.float32))


def searched(width: int, height: int, settings: Settings | None = None) -> list[list[int]]:
    frame = np.zeros((height, width, 3), np.uint8)
    engine = make_search(MODEL, settings or Settings(), width, height)
    boxes: list[list[int]] = engine.search(frame).boxes.tolist()
    return boxes


def band(size: int, top: int, bottom: int) -> WindowSettings:
    return WindowSettings(size=size, overlap=0.5, top=top, bottom=bottom)


def test_a_720p_frame_is_searched_at_831_windows_the_large_ones_first() -> None:
    boxes = searched(1280, 720)
    assert [box[2] for box in boxes] == [128] * 423 + [64] * 408


@pytest.mark.parametrize(("width", "height"), [(640, 360), (1920, 1080), (1279, 721), (853, 480)])
def test_the_window_sets_scale_with_the_rows_of_the_frame(width: int, height: int) -> None:
    boxes = np.array(searched(width, height))
    factor = height / 720
    large = boxes[boxes[:, 2] == boxes[:, 2].max()]
    small = boxes[boxes[:, 2] == boxes[:, 2].min()]
    assert large[0].tolist() == [0, *[int(n * factor + 0.5) for n in (380, 128, 128)]]
    assert small[0].tolist() == [0, *[int(n * factor + 0.5) for n in (400, 64, 64)]]


@pytest.mark.parametrize(
    ("width", "height"), [(1280, 720), (1277, 719), (1281, 721), (129, 720), (333, 77)]
)
def test_all_windows_lie_inside_the_frame(width: int, height: int) -> None:
    x, y, w, h = np.array(searched(width, height)).T
    assert (x >= 0).all()
    assert (y >= 0).all()
    assert (x + w <= width).all()
    assert (y + h <= height).all()


def test_windows_below_the_frame_are_left_out() -> None:
    sets = SearchSettings(windows=(band(64, 600, 900), band(64, 700, 800)))
    first, second = lay_windows(sets, 640, 720)
    assert {y for _, y, _, _ in first.tolist()} == {600, 632}
    assert second.shape == (0, 4)


def test_a_set_that_does_not_fit_leaves_the_others() -> None:
    # the large windows are wider than the frame, the small ones are not
    assert {box[2] for box in searched(100, 720)} == {64}


@pytest.mark.parametrize(("width", "height"), [(63, 720), (1, 1), (2, 2), (40, 2000)])
def test_a_frame_without_room_for_any_window_is_refused(width: int, height: int) -> None:
    with pytest.raises(
        ImageError, match=rf"no search window fits .* {width}×{height} pixels; give"
    ):
        make_search(MODEL, Settings(), width, height)


def test_a_frame_that_ends_above_the_search_rows_is_refused() -> None:
    settings = Settings(search=SearchSettings(windows=(band(64, 800, 900),)))
    with pytest.raises(ImageError, match="no search window fits"):
        make_search(MODEL, settings, 1280, 720)


def test_no_window_is_ever_smaller_than_a_pixel() -> None:
    settings = Settings(reference_height=100_000)
    tiny = scale_lengths(settings.search, 300 / 100_000)
    assert all(len(boxes) == 0 for boxes in lay_windows(tiny, 400, 300))

"""Pictures of every stage of the detection."""

import numpy as np
import pytest

from red_cars import CAR, SCALE, SETTINGS, red_finder, road
from vdet.boxes import Image
from vdet.config.kinds import WindowSettings
from vdet.config.schema import SvmSettings
from vdet.config.section import scale_lengths
from vdet.detect.svm.detector import Heat, SvmModel, blend_heat, draw_features
from vdet.media import Picture

ROWS = SETTINGS.svm
SMALLER_SET = scale_lengths(WindowSettings(size=24, overlap=0.5, top=100, bottom=160), SCALE)


def pictures_of(image: Image, settings: SvmSettings = ROWS) -> dict[str, Image]:
    """Detect in a still picture and draw the stages."""
    height, width = image.shape[:2]
    detector = SvmModel(red_finder(), settings).for_video(width, height, [image])
    return detector.stage_images(image, detector.detect(detector.search(Picture(image), None)))


def test_hits_are_drawn_around_the_car_alone() -> None:
    changed = (pictures_of(road(CAR))["hits"] != road(CAR)).any(axis=2)
    rows, columns = np.nonzero(changed)
    assert CAR.x1 - 32 <= columns.min() < columns.max() < CAR.x2 + 40
    assert CAR.y1 - 64 <= rows.min() < rows.max() < CAR.y2 + 40


def test_every_window_set_has_a_grid_of_its_own_colour() -> None:
    def colors(settings: SvmSettings) -> set[tuple[int, ...]]:
        picture = pictures_of(road(), settings)["windows"]
        return {tuple(color) for color in picture[100:160].reshape(-1, 3).tolist()}

    sets = (*ROWS.search.windows, SMALLER_SET)
    more = ROWS.model_copy(update={"search": ROWS.search.model_copy(update={"windows": sets})})
    one, two = colors(ROWS), colors(more)
    assert any(max(color) == 255 for color in one)
    assert sum(max(color) == 255 for color in two) > sum(max(color) == 255 for color in one)


def test_strokes_run_along_edges_and_bars_count_pixels() -> None:
    features = ROWS.features
    patch = np.full((features.patch, features.patch, 3), 40, np.uint8)
    patch[:, features.patch // 2 - 1 :] = 200
    enlarged, strokes, bars = np.split(draw_features(patch, features), 3, axis=1)
    assert (enlarged[:, :150].max(), enlarged[:, 250:].min()) == (40, 200)
    rows, columns = np.nonzero(strokes.max(axis=2) > 200)
    assert len(rows)
    assert np.ptp(rows) > 5 * np.ptp(columns)
    assert np.count_nonzero(bars[:128].any(axis=(0, 2))) == 2 * len(bars) // features.histogram.bins


@pytest.mark.parametrize("shrink", [1, 4])
def test_heat_of_a_shrunk_map_lies_in_its_place(shrink: int) -> None:
    values = np.zeros((-(-21 // shrink), -(-30 // shrink)), np.float32)
    values[1, 2] = 5
    blended = blend_heat(np.zeros((21, 30, 3), np.uint8), Heat(values, shrink))
    assert blended.shape == (21, 30, 3)
    rows, columns = np.nonzero(blended.min(axis=2) > 190)
    assert set(rows.tolist()) == set(range(shrink, min(21, 2 * shrink)))
    assert set(columns.tolist()) == set(range(2 * shrink, min(30, 3 * shrink)))


def test_what_is_not_hot_enough_is_darkened() -> None:
    image = road(CAR)
    threshold = pictures_of(image)["threshold"]
    middle = int((CAR.y1 + CAR.y2) / 2), int((CAR.x1 + CAR.x2) / 2)
    assert (threshold[middle] == image[middle]).all()
    assert (threshold[-1, -1] == image[-1, -1] // 3).all()

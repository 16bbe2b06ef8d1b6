"""A search of some regions: the same results inside, and fewer windows."""

import numpy as np
import pytest

from boxing import rounded
from red_cars import CAR, HEIGHT, SETTINGS, THREE_SETS, WIDTH, red_finder, road
from seed import SEED
from textured_road import textured_road
from vdet.boxes import Box, from_sizes
from vdet.config.schema import Settings, SvmSettings
from vdet.detect.protocol import LimitableDetector
from vdet.detect.svm.detector import SvmDetector, SvmModel
from vdet.detect.svm.kind import shipped_model
from vdet.detect.svm.model import load_model
from vdet.detect.svm.search import FrameSearch, lay_grids
from vdet.detect.svm.windows import limited_grid
from vdet.errors import ImageError
from vdet.media import Picture
from vdet.regions import SearchArea


def area_of(box: Box, width: int, height: int) -> SearchArea:
    pixels = np.zeros((height, width), bool)
    box.cut(pixels)[:] = True
    return SearchArea(pixels)


@pytest.mark.parametrize("settings", [SvmSettings(), SEED.svm], ids=["default", "seed"])
@pytest.mark.parametrize(
    "box", [Box.sized(700, 420, 200, 50), Box.sized(0, 380, 333, 340), Box.sized(901, 433, 379, 77)]
)
def test_windows_that_touch_the_area_look_the_same(settings: SvmSettings, box: Box) -> None:
    picture, model = Picture(textured_road(1280, 720)), load_model(shipped_model(settings))
    area = area_of(box, 1280, 720)
    whole = FrameSearch(model, settings, 1280, 720)
    part = FrameSearch(model, settings, 1280, 720, area=area)
    assert sum(map(len, part.grids)) < sum(map(len, whole.grids))
    all_windows, some = whole.search(picture), part.search(picture)
    near, kept = (area.touches(from_sizes(each.boxes)) for each in (all_windows, some))
    assert np.array_equal(all_windows.boxes[near], some.boxes[kept])
    assert np.allclose(all_windows.probabilities[near], some.probabilities[kept], atol=1e-6)
    assert np.allclose(all_windows.vehicles[near], some.vehicles[kept], atol=1e-3)
    assert np.allclose(all_windows.shares[near], some.shares[kept])


@pytest.mark.parametrize("settings", [SETTINGS, THREE_SETS], ids=["rows", "perspective"])
def test_a_vehicle_in_the_area_is_found_as_before(settings: Settings) -> None:
    detector = SvmModel(red_finder(), settings.svm).for_video(WIDTH, HEIGHT, [road(CAR)])
    assert isinstance(detector, LimitableDetector)
    near, far = Box.sized(90, 130, 80, 50), Box.sized(300, 100, 20, 140)
    found = {}
    for name, each in {
        "whole": detector,
        "near": detector.limited_to(area_of(near, WIDTH, HEIGHT)),
        "far": detector.limited_to(area_of(far, WIDTH, HEIGHT)),
    }.items():
        for index in range(settings.svm.heat.frames + 1):
            found[name] = rounded(each.detect(each.search(Picture(road(CAR)), index)))
    assert len(found["whole"]) == 1
    assert found["near"] == found["whole"]
    assert found["far"] == []


def test_regions_that_no_window_reaches_are_refused() -> None:
    detector = SvmDetector(red_finder(), SETTINGS.svm, WIDTH, HEIGHT)
    with pytest.raises(ImageError, match="no search window reaches the regions"):
        detector.limited_to(area_of(Box.sized(0, 0, 320, 20), WIDTH, HEIGHT))


def test_a_set_out_of_reach_has_no_windows() -> None:
    settings = SvmSettings()
    model = load_model(shipped_model(settings))
    area = area_of(Box.sized(700, 520, 60, 10), 1280, 720)
    grids = lay_grids(settings, model.features, 1280, 720)
    kept = [limited_grid(grid, area, model.features) for grid in grids]
    assert kept[0] is None, "the first set reaches the area"
    low = SvmDetector(model, settings, 1280, 720, area=area)
    image = textured_road(1280, 720)
    candidates = low.search(Picture(image), 0)
    expected = [part.boxes for part in kept if part]
    np.testing.assert_array_equal(candidates.windows.boxes, np.concatenate(expected))
    assert "windows" in low.stage_pictures(image, low.detect(candidates))

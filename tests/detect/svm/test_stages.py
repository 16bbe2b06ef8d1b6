"""Pictures of every stage of the detection."""

from pathlib import Path

import numpy as np
import pytest

from red_cars import CAR, COLOUR, HEIGHT, PERSPECTIVE, SETTINGS, WIDTH, red_finder, road
from vdet.config.schema import FeatureSettings, Settings, WindowSettings
from vdet.detect.svm.detector import Detection, detect_still
from vdet.detect.svm.heat import Heat
from vdet.detect.svm.stages import LabelledBox, blend_heat, write_stages
from vdet.draw.boxes import color_of
from vdet.geometry import Box
from vdet.media.images import Image, read_image

NAMES = ["1-patches.png", "2-windows.png", "3-hits.png", "4-heat.png", "5-boxes.png"]
SMALLER_SET = WindowSettings(size=24, overlap=0.5, top=100, bottom=160)
OUTSIDE = WindowSettings(size=240, overlap=0.5, top=120, bottom=360)


def detected(image: Image, settings: Settings = SETTINGS) -> Detection:
    return detect_still(red_finder(), settings, image)


def written(
    folder: Path,
    image: Image,
    boxes: list[LabelledBox],
    settings: Settings = SETTINGS,
    features: FeatureSettings = COLOUR,
) -> dict[str, Image]:
    """Write the stages of a frame and read them again; name → picture."""
    write_stages(folder, image, detected(image, settings), boxes, features=features)
    return {path.name: read_image(path) for path in sorted(folder.iterdir())}


def with_windows(*sets: WindowSettings) -> Settings:
    search = SETTINGS.search.model_copy(update={"windows": sets})
    return SETTINGS.model_copy(update={"search": search})


@pytest.mark.parametrize("image", [road(CAR), road()], ids=["a car", "nothing found"])
def test_all_five_are_written(tmp_path: Path, image: Image) -> None:
    pictures = written(tmp_path / "new" / "stages", image, [])
    assert list(pictures) == NAMES
    for name in NAMES[1:]:
        assert pictures[name].shape == image.shape


def test_the_frame_itself_is_not_drawn_on(tmp_path: Path) -> None:
    image = road(CAR)
    written(tmp_path, image, [(CAR, "#1")])
    np.testing.assert_array_equal(image, road(CAR))


def test_where_nothing_is_hit_the_frame_is_shown_as_it_is(tmp_path: Path) -> None:
    pictures = written(tmp_path, road(), [])
    np.testing.assert_array_equal(pictures["3-hits.png"], road())
    np.testing.assert_array_equal(pictures["5-boxes.png"], road())


def test_the_patches_are_the_likeliest_and_the_unlikeliest_window(tmp_path: Path) -> None:
    likely, unlikely = np.vsplit(written(tmp_path, road(CAR), [])["1-patches.png"], 2)
    assert (likely[100:150, 50:100] == (0, 0, 255)).all()
    assert (unlikely[100:150, 50:100] == 90).all()


def test_hits_are_drawn_around_the_car_alone(tmp_path: Path) -> None:
    changed = (written(tmp_path, road(CAR), [])["3-hits.png"] != road(CAR)).any(axis=2)
    rows, columns = np.nonzero(changed)
    assert CAR.x - 32 <= columns.min() < columns.max() < CAR.right + 40
    assert CAR.y - 32 <= rows.min() < rows.max() < CAR.bottom + 40


def test_heat_is_brightest_on_the_car(tmp_path: Path) -> None:
    heat = written(tmp_path, road(CAR), [])["4-heat.png"].sum(axis=2, dtype=int)
    on_car = heat[CAR.y + 10 : CAR.bottom - 10, CAR.x + 10 : CAR.right - 10]
    assert on_car.min() > heat[200:, 200:].max()


def test_final_boxes_are_drawn_with_their_labels(tmp_path: Path) -> None:
    plain = written(tmp_path / "a", road(), [])["5-boxes.png"]
    boxed = written(tmp_path / "b", road(), [(CAR, "")])["5-boxes.png"]
    labelled = written(tmp_path / "c", road(), [(CAR, "#1")])["5-boxes.png"]
    assert (boxed[CAR.y, CAR.x : CAR.right] != plain[CAR.y, CAR.x : CAR.right]).any(axis=1).all()
    assert (labelled[: CAR.y] != boxed[: CAR.y]).any()


def test_regions_are_drawn_even_where_there_is_no_final_box(tmp_path: Path) -> None:
    (region,) = detected(road(CAR)).regions
    picture = written(tmp_path, road(CAR), [])["5-boxes.png"]
    side = picture[region.box.y : region.box.bottom, region.box.x]
    assert (side == 255).all()


def test_every_window_set_has_a_grid_of_its_own_colour(tmp_path: Path) -> None:
    def colors(folder: Path, settings: Settings) -> set[tuple[int, ...]]:
        picture = written(folder, road(), [], settings)["2-windows.png"]
        return {tuple(color) for color in picture[100:160].reshape(-1, 3).tolist()}

    one = colors(tmp_path / "one", SETTINGS)
    two = colors(tmp_path / "two", with_windows(*SETTINGS.search.windows, SMALLER_SET))
    assert any(max(color) == 255 for color in one)
    assert sum(max(color) == 255 for color in two) > sum(max(color) == 255 for color in one)


def test_a_set_without_room_in_the_frame_is_passed_over(tmp_path: Path) -> None:
    pictures = written(tmp_path, road(CAR), [], with_windows(*SETTINGS.search.windows, OUTSIDE))
    assert pictures["2-windows.png"].shape == (HEIGHT, WIDTH, 3)


def beyond(share: float) -> Settings:
    """Search by windows that reach beyond the frame's sides."""
    perspective = PERSPECTIVE.search.perspective.model_copy(update={"beyond": share})
    search = PERSPECTIVE.search.model_copy(update={"perspective": perspective})
    return PERSPECTIVE.model_copy(update={"search": search})


@pytest.mark.parametrize("share", [0, 0.5, 1])
@pytest.mark.parametrize("x", [-40, 20, WIDTH - 40])
def test_windows_beyond_the_sides_are_drawn_as_far_as_they_are_seen(
    tmp_path: Path, share: float, x: int
) -> None:
    image = road(CAR.moved_to(x, CAR.y).clipped(WIDTH, HEIGHT))
    pictures = written(tmp_path, image, [], beyond(share))
    assert list(pictures) == NAMES
    for name in NAMES[1:]:
        assert pictures[name].shape == image.shape
    grid = pictures["2-windows.png"]
    for number in (0, 1):
        rows = (grid == color_of(number)).all(axis=2).any(axis=1)
        assert rows.sum() > 6, "a row of points for each row of windows"


def test_the_likeliest_window_is_shown_with_the_columns_that_it_repeats(tmp_path: Path) -> None:
    edge = road(Box(0, 110, 8, 60))  # its window sees red where the frame has ended
    likely = np.vsplit(written(tmp_path, edge, [], beyond(0.75))["1-patches.png"], 2)[0]
    patch = likely[28:220, 4:196]
    red = (patch[..., 2].astype(int) - patch[..., 0]) > 100
    assert red.mean() > 0.85


@pytest.mark.parametrize("space", ["YCrCb", "HSV", "LUV", "HLS", "YUV", "RGB"])
def test_patches_are_shown_with_the_features_of_the_model(tmp_path: Path, space: str) -> None:
    features = FeatureSettings(color_space=space)
    sheet = written(tmp_path, road(CAR), [], features=features)["1-patches.png"]
    assert sheet.shape[1] > written(tmp_path, road(CAR), [])["1-patches.png"].shape[1]


def test_earlier_stages_are_replaced(tmp_path: Path) -> None:
    written(tmp_path, road(CAR), [])
    pictures = written(tmp_path, road(), [])
    assert list(pictures) == NAMES
    np.testing.assert_array_equal(pictures["3-hits.png"], road())


def flat(value: float) -> Heat:
    return Heat(np.full((24, 32), value, np.float32))


class TestHeat:
    def test_without_heat_the_picture_is_only_darker(self) -> None:
        image = np.random.default_rng(0).integers(0, 256, (24, 32, 3), np.uint8)
        blended = blend_heat(image, flat(0))
        np.testing.assert_allclose(blended, image / 2, atol=1)

    def test_is_white_at_its_peak_and_red_below(self) -> None:
        heat = flat(0)
        heat.values[5, 7], heat.values[9, 9] = 8.0, 2.0
        blended = blend_heat(np.zeros((24, 32, 3), np.uint8), heat)
        assert blended[5, 7].min() > 190
        blue, green, red = blended[9, 9].tolist()
        assert red > 100 > green == blue == 0
        assert blended[0, 0].max() < 12

    def test_does_not_depend_on_the_unit_of_heat(self) -> None:
        rng = np.random.default_rng(0)
        image = rng.integers(0, 256, (24, 32, 3), np.uint8)
        values = rng.integers(0, 9, (24, 32)).astype(np.float32)
        np.testing.assert_array_equal(
            blend_heat(image, Heat(values)), blend_heat(image, Heat(values * 4))
        )

    def test_flat_heat_is_all_peak(self) -> None:
        assert blend_heat(np.zeros((24, 32, 3), np.uint8), flat(3)).min() > 190

    @pytest.mark.parametrize("shrink", [2, 4, 8])
    def test_of_a_shrunk_map_lies_where_it_belongs(self, shrink: int) -> None:
        values = np.zeros((-(-21 // shrink), -(-30 // shrink)), np.float32)
        values[1, 2] = 5
        blended = blend_heat(np.zeros((21, 30, 3), np.uint8), Heat(values, shrink))
        assert blended.shape == (21, 30, 3)
        rows, columns = np.nonzero(blended.min(axis=2) > 190)
        assert set(rows.tolist()) == set(range(shrink, min(21, 2 * shrink)))
        assert set(columns.tolist()) == set(range(2 * shrink, min(30, 3 * shrink)))

    def test_the_picture_itself_is_not_changed(self) -> None:
        image = np.full((24, 32, 3), 255, np.uint8)
        blend_heat(image, flat(1))
        assert image.min() == 255

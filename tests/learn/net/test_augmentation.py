"""Training pictures: their boxes lie where the vehicles are, whatever was changed."""

from dataclasses import replace

import numpy as np
import pytest

from learn.net.blocks import block_picture, block_source
from vdet.boxes import coverage
from vdet.config.schema import NetworkTrainingSettings
from vdet.learn.net.augmentation import (
    ImageDrawing,
    SampleDrawer,
    rare_objects,
    repeat_factors,
    whole_objects,
    with_occlusion,
    with_rare_objects,
    with_signs,
    with_weather,
)
from vdet.learn.net.sources import MAX_PIXELS, NetSample, NetSource

PLAIN = ImageDrawing(width=256, height=128, magnified=1.0, mosaics=0.0)
MOSAIC = ImageDrawing(width=256, height=128, magnified=1.0, mosaics=1.0)
SETTINGS = NetworkTrainingSettings()
WHITE = np.full((128, 256, 3), 255, np.uint8)


def draw(seed: int, drawing: ImageDrawing, source: NetSource | None = None) -> NetSample:
    drawer = SampleDrawer([source or block_source(8)], SETTINGS)
    return drawer.draw(np.random.default_rng(seed), drawing)


def without_objects(image: np.ndarray) -> NetSample:
    empty = np.zeros((0, 4), np.float32), np.zeros(0, np.int64), np.zeros(0, np.bool_)
    return NetSample(image, *empty)


def black_on_white() -> NetSource:
    """Return a source of one picture: a black block in the middle of white."""
    image = WHITE.copy()
    image[48:80, 96:160] = 0
    boxes = np.array([[96, 48, 160, 80]], np.float32)
    return NetSource("block", [NetSample(image, boxes, np.array([0]), np.array([False]))])


@pytest.mark.parametrize("seed", range(8))
def test_the_box_lies_around_what_it_is_the_box_of(seed: int) -> None:
    sample = draw(seed, PLAIN, black_on_white())
    dark = sample.image.mean(axis=2)
    for box in sample.boxes[~sample.ignored]:
        left, top, right, bottom = box.round().astype(int)
        if min(right - left, bottom - top) < 8:
            continue
        inside = dark[top + 3 : bottom - 3, left + 3 : right - 3]
        border = np.ones(dark.shape, bool)
        border[max(0, top - 3) : bottom + 3, max(0, left - 3) : right + 3] = False
        assert np.median(inside) < 110
        assert np.median(dark[border]) > np.median(inside)


@pytest.mark.parametrize("drawing", [PLAIN, MOSAIC], ids=["plain", "mosaic"])
def test_every_box_lies_in_the_picture_and_the_same_seed_draws_the_same(
    drawing: ImageDrawing,
) -> None:
    sample, again, other = (draw(seed, drawing) for seed in (3, 3, 4))
    assert np.array_equal(sample.image, again.image)
    assert not np.array_equal(sample.image, other.image)
    assert sample.image.shape == (128, 256, 3)
    assert sample.image.dtype == np.uint8
    assert (sample.boxes[:, :2] >= 0).all()
    assert (sample.boxes[:, 2:] <= [256, 128]).all()
    assert (sample.boxes[:, 2:] > sample.boxes[:, :2]).all()
    assert len(sample.boxes) == len(sample.classes) == len(sample.ignored)


def test_a_vehicle_of_which_little_is_left_is_ignored() -> None:
    wide = np.array([[0, 0, 256, 128]], np.float32)
    source = NetSource("wide", [NetSample(WHITE, wide, np.array([0]), np.array([False]))])
    drawing = ImageDrawing(width=256, height=128, magnified=4.0, mosaics=0.0)
    is_ignored = [draw(seed, drawing, source).ignored.all() for seed in range(20)]
    assert 12 <= sum(is_ignored) < 20  # all but those that show it near


def test_large_pictures_are_held_smaller_with_their_boxes() -> None:
    sample = block_picture(1, width=1280, height=720).shrunk()
    height, width = sample.image.shape[:2]
    assert height * width == pytest.approx(MAX_PIXELS, rel=0.01)
    factor = width / 1280
    assert sample.boxes == pytest.approx(block_picture(1, 1280, 720).boxes * factor, rel=0.01)


def test_small_sources_and_those_with_a_weight_come_more_often(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    small = NetSource("small", [block_picture(0)])
    large = NetSource("large", [without_objects(WHITE)] * 9)
    monkeypatch.setattr("vdet.learn.net.augmentation.REPEAT_THRESHOLD", 0.0)

    def drawn(settings: NetworkTrainingSettings) -> int:
        drawer = SampleDrawer([small, large], settings)
        picks = [drawer._pick(np.random.default_rng(seed)) for seed in range(200)]
        return sum(pick is small.samples[0] for pick in picks)

    assert 30 <= drawn(SETTINGS) <= 70  # one in four, not one in ten
    assert 80 <= drawn(SETTINGS.model_copy(update={"weights": {"small": 3.0}})) <= 120  # half


def test_pictures_with_rare_classes_or_without_objects_come_more_often() -> None:
    cars = [replace(car, classes=np.zeros_like(car.classes)) for car in block_source(9).samples]
    [block] = black_on_white().samples
    # The rare one is in a tenth of the pictures: √(0.4 / 0.1) = 2 times.
    for rare in (replace(block, classes=np.array([1])), without_objects(WHITE)):
        factors = repeat_factors([*cars, rare], np.full(10, 0.1), 0.4)
        assert factors.tolist() == pytest.approx([1.0] * 9 + [2.0])


def test_signs_are_background_and_cover_no_object() -> None:
    [block] = black_on_white().samples
    drawn = [with_signs(np.random.default_rng(seed), block) for seed in range(200)]
    with_sign = [sample for sample in drawn if not np.array_equal(sample.image, block.image)]
    assert 30 <= len(with_sign) <= 90
    for sample in with_sign:
        assert np.array_equal(sample.boxes, block.boxes)
        # A sign may cover a fifth, and there may be three and their posts.
        assert (sample.image[48:80, 96:160] == 0).all(axis=2).mean() > 0.3
    hidden = [(sample.image[48:80, 96:160] != 0).mean() for sample in with_sign]
    assert np.mean(hidden) < 0.05


def test_objects_of_rare_classes_are_pasted_with_their_boxes() -> None:
    blocks = [replace(e, classes=np.zeros_like(e.classes)) for e in block_source(20).samples]
    [white] = black_on_white().samples
    rare = rare_objects(whole_objects([*blocks, replace(white, classes=np.array([1]))]))
    plain = without_objects(np.full((352, 640, 3), 255, np.uint8))
    drawn = [with_rare_objects(np.random.default_rng(seed), plain, rare) for seed in range(40)]
    pasted = [item for item in drawn if len(item.boxes)]
    assert 4 <= len(pasted) <= 24
    assert plain.image.min() == 255, "the picture itself is not changed"
    for sample in pasted:
        assert set(sample.classes.tolist()) == {1}
        dark = sample.image.mean(axis=2) < 128
        inside = np.zeros_like(dark)
        for left, top, right, bottom in sample.boxes.round().astype(int):
            inside[top:bottom, left:right] = True
        assert np.mean(dark == inside) > 0.99


def test_vehicles_are_pasted_in_front_of_others_which_keep_their_boxes() -> None:
    [block] = black_on_white().samples
    drawn = [
        with_occlusion(np.random.default_rng(seed), block, [*whole_objects([block]).values()])
        for seed in range(100)
    ]
    pairs = [sample for sample in drawn if len(sample.boxes) == 2]
    assert 15 <= len(pairs) <= 60
    for sample in pairs:
        behind, front = sample.boxes.astype(np.float64)
        assert np.array_equal(behind, block.boxes[0])
        assert front[3] >= behind[3] - 1, "what is nearer is lower"
        assert 0.05 < coverage(behind[np.newaxis], front[np.newaxis])[0, 0] < 0.8


def test_weather_comes_in_some_pictures_and_night_is_dark() -> None:
    day = np.full((128, 256, 3), 200, np.uint8)
    boxes = np.array([[40, 40, 100, 90]], np.float32)
    drawn = [with_weather(np.random.default_rng(seed), day, boxes) for seed in range(400)]
    changed = [image for image in drawn if not np.array_equal(image, day)]
    dark = [image for image in changed if np.median(image) < 120]
    assert {image.shape for image in drawn} == {day.shape}
    assert 60 <= len(changed) <= 180
    assert 20 <= len(dark) <= 90
    assert any(image.max() > 220 for image in dark)  # lamps
    bright = [image for image in changed if np.median(image) >= 120]
    rainy = [image for image in bright if np.ptp(image, axis=1).max()]  # fog fills whole rows
    assert 20 <= len(rainy) <= 70
    assert any(np.median(image) < 185 for image in rainy)  # as behind spray

"""The picture of the paths of vehicles."""

import numpy as np
import pytest

from traffic.scenes import HEIGHT, WIDTH, Path, frames, through
from vdet.boxes import Image
from vdet.pages.traffic import direction_color, draw_marks, path_marks
from vdet.polygons import Point
from vdet.traffic.records import VehicleRecords

GREY = 90


@pytest.fixture
def image() -> Image:
    return np.full((HEIGHT, WIDTH, 3), GREY, np.uint8)


def paths_drawn(image: Image, *paths: Path) -> None:
    records = VehicleRecords(WIDTH)
    for frame in frames(*paths):
        records.add(frame)
    draw_marks(image, path_marks(records.end(), (WIDTH, HEIGHT)))


def has_color(image: Image, point: Point, color: tuple[int, int, int]) -> bool:
    x, y = map(round, point)
    near = image[y - 3 : y + 4, x - 3 : x + 4].reshape(-1, 3).astype(int)
    return bool((np.abs(near - color).max(axis=1) < 40).any())


def test_a_path_has_the_colour_of_its_direction(image: Image) -> None:
    paths_drawn(image, through((0, 200, 200), (5, 900, 200)), through((0, 900, 400), (5, 200, 400)))
    for x in (300, 600, 800):
        assert has_color(image, (x, 200), direction_color((0, 0), (1, 0)))
        assert has_color(image, (x, 400), direction_color((1, 0), (0, 0)))
    assert not has_color(image, (600, 400), direction_color((0, 0), (1, 0)))


def test_vehicles_that_stand_have_no_path(image: Image) -> None:
    empty = image.copy()
    paths_drawn(empty)
    paths_drawn(image, through((0, 600, 300), (5, 610, 300)))
    assert (image == empty).all()

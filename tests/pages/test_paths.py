"""The picture of the paths of vehicles."""

import numpy as np
import pytest

from traffic.scenes import HEIGHT, WIDTH, Path, frames, through
from vdet.boxes import Image, coverage
from vdet.config.scene import LineSettings, TrafficSettings
from vdet.draw import draw_label
from vdet.pages.traffic import border_marks, direction_color, draw_marks, path_marks
from vdet.polygons import Point
from vdet.traffic.crossings import lines_and_zones
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


@pytest.mark.parametrize("end", [(0.5, 0.9), (0.52, 0.1), (0.9, 0.5), (0.1, 0.45), (0.8, 0.8)])
def test_the_labels_of_a_line_do_not_overlap(image: Image, end: Point) -> None:
    line = LineSettings(name="gate", start=(0.5, 0.5), end=end, left="left", right="right")
    [placed], _ = lines_and_zones(TrafficSettings(lines=(line,)), WIDTH, HEIGHT)
    labels = [
        (mark.label, draw_label(image, mark.label, mark.at, mark.color))
        for mark in border_marks(placed, {("gate", "left"): 14})
    ]
    assert [text for text, _ in labels] == ["gate", "left 14", "right 0"]
    boxes = np.array([(tag.x1, tag.y1, tag.x2, tag.y2) for _, tag in labels])
    assert (coverage(boxes, boxes) == np.eye(3)).all()

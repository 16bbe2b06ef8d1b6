"""Trails of vehicles."""

import numpy as np

from vdet.draw.boxes import BLACK
from vdet.draw.trails import draw_trail
from vdet.media.images import Image

LEVEL = [(20.0 + 5 * n, 60.0) for n in range(40)]


def trail(points: list[tuple[float, float]], width: int = 6) -> Image:
    image = np.full((120, 240, 3), 255, np.uint8)
    draw_trail(image, points, BLACK, width)
    return image


def heights(image: Image) -> list[int]:
    """Return how many rows are dark in each column."""
    dark: list[int] = (image.max(axis=2) < 128).sum(axis=0).tolist()
    return dark


def test_a_trail_goes_through_its_points_without_a_gap() -> None:
    rows = heights(trail(LEVEL))
    assert all(rows[20:215])
    assert not any(rows[:15] + rows[222:])


def test_it_grows_thinner_into_the_past() -> None:
    rows = heights(trail(LEVEL, width=8))
    assert rows[30] < rows[90] < rows[150] < rows[205]


def test_points_that_tremble_give_a_smooth_line() -> None:
    shaken = [(x, y + 8 * (-1) ** number) for number, (x, y) in enumerate(LEVEL)]
    middle = trail(shaken, width=2)[:, 60:180].max(axis=2) < 128
    rows = np.nonzero(middle)[0]
    assert max(abs(rows - 60)) <= 3


def test_points_may_lie_far_outside_the_picture() -> None:
    image = trail([(-1e9, 60.0), (120.0, 60.0), (1e9, 60.0)])
    assert all(heights(image)[130:230])

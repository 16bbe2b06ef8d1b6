import itertools

import numpy as np
import numpy.typing as npt
import pytest

from vdet.boxes import Box, Image
from vdet.draw import (
    BLACK,
    GREEN,
    RED,
    WHITE,
    color_of,
    draw_box,
    draw_label,
    draw_labels,
    line_width,
    text_color,
)

HEIGHTS = [180, 240, 360, 480, 540, 720, 1080, 2160]


def blank(width: int = 320, height: int = 240) -> Image:
    return np.full((height, width, 3), 255, np.uint8)


def touched(image: Image) -> npt.NDArray[np.bool_]:
    """Tell which pixels of a picture that was `blank` have been drawn on."""
    return np.asarray((image != 255).any(axis=2))


def covered(box: Box, image: Image) -> npt.NDArray[np.bool_]:
    mask = np.zeros(image.shape[:2], bool)
    mask[max(0, box.y1) : max(0, box.y2), max(0, box.x1) : max(0, box.x2)] = True
    return mask


def shrunk(box: Box, margin: int) -> Box:
    return Box.sized(
        box.x1 + margin, box.y1 + margin, box.width - 2 * margin, box.height - 2 * margin
    )


def letters(image: Image) -> int:
    """Count the dark pixels of a label's text; tags and pictures here are bright."""
    return int((image.max(axis=2) < 110).sum())


@pytest.mark.parametrize("height", HEIGHTS)
def test_the_outline_lies_just_inside_the_box(height: int) -> None:
    image = blank(400, height)
    box = Box.sized(50, 60, 100, 80)
    draw_box(image, box, (0, 0, 0))
    rows, columns = np.nonzero(touched(image))
    assert (columns.min(), rows.min()) == (box.x1, box.y1)
    assert (columns.max() + 1, rows.max() + 1) == (box.x2, box.y2)
    assert not (touched(image) & covered(shrunk(box, line_width(image) + 2), image)).any()


class TestLabels:
    def test_a_label_moves_where_it_would_hide_another_box(self) -> None:
        image = blank()
        far, near = Box.sized(100, 60, 60, 40), Box.sized(100, 105, 80, 60)
        draw_labels(image, [far, near], [["#1"], ["#2"]], [GREEN, RED])
        drawn = touched(image)
        assert not (drawn & (covered(far, image) | covered(near, image))).any()
        rows = np.flatnonzero((image == GREEN).all(axis=2).any(axis=1))
        assert rows.max() == far.y1 - 1, "the first is above its box"
        rows = np.flatnonzero((image == RED).all(axis=2).any(axis=1))
        assert rows.min() == near.y2, "the second is below"

    def test_the_longest_text_is_taken_that_is_no_wider_than_the_box(self) -> None:
        wide, narrow = Box.sized(10, 100, 200, 40), Box.sized(220, 100, 40, 40)
        chosen, expected = blank(), blank()
        draw_labels(chosen, [wide, narrow], [["#1 car", "#1"]] * 2, [GREEN] * 2)
        draw_label(expected, "#1 car", (wide.x1, wide.y1), GREEN)
        draw_label(expected, "#1", (narrow.x1, narrow.y1), GREEN)
        np.testing.assert_array_equal(chosen, expected)


CORNERS = [(x, y) for x in (-50, 0, 160, 319, 400) for y in (-50, 0, 120, 239, 300)]


def runs(line: npt.NDArray[np.bool_]) -> list[int]:
    """Return the lengths of the runs of drawn pixels along a line."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], line, [False]])))
    return [int(length) for length in edges[1::2] - edges[::2]]


@pytest.mark.parametrize("height", HEIGHTS)
def test_a_dashed_box_has_several_dashes_and_gaps_on_each_side_at_any_frame_height(
    height: int,
) -> None:
    image = blank(2 * height, height)
    box = Box.sized(height // 4, height // 4, height // 5, height // 6)
    draw_box(image, box, BLACK, dashed=True)
    top = box.cut(touched(image))[0]
    left = box.cut(touched(image))[:, 0]
    for side in (top, left):
        assert len(runs(side)) >= 3
        assert 0.4 < side.mean() < 0.75
        assert side[0]
        assert side[-1]


class TestLabel:
    @pytest.mark.parametrize("corner", CORNERS)
    @pytest.mark.parametrize("height", [240, 720])
    def test_the_whole_text_stays_in_the_picture(
        self, corner: tuple[int, int], height: int
    ) -> None:
        middle, image = blank(height=height), blank(height=height)
        draw_label(middle, "heat 12.3", (100, 120), GREEN)
        draw_label(image, "heat 12.3", (corner[0], corner[1] * height // 240), GREEN)
        assert letters(image) == letters(middle) > 10

    @pytest.mark.parametrize("height", HEIGHTS)
    def test_digits_are_at_least_seven_pixels_high_and_about_a_fiftieth_of_the_frame(
        self, height: int
    ) -> None:
        image = blank(2 * height, height)
        draw_label(image, "0", (height, height // 2), WHITE)
        rows, _ = np.nonzero(touched(image))
        letter = int(rows.max() - rows.min() + 1)
        assert max(7, 0.016 * height) <= letter <= max(12, 0.024 * height)

    def test_text_is_dark_on_bright_tags_and_bright_on_dark_ones(self) -> None:
        assert [text_color(color) for color in (GREEN, WHITE, BLACK)] == [BLACK, BLACK, WHITE]


def test_neighbouring_ids_differ_clearly() -> None:
    colors = [np.array(color_of(number)) for number in range(100)]
    pairs = [*itertools.pairwise(colors), *zip(colors, colors[2:], strict=False)]
    assert min(int(abs(a - b).max()) for a, b in pairs) > 100

import itertools

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.detect.svm.heat import Heat
from vdet.detect.svm.stages import blend_heat
from vdet.draw.boxes import (
    GREEN,
    color_of,
    draw_box,
    draw_label,
    line_width,
)
from vdet.geometry import Box
from vdet.media.images import Image
from vdet.pipeline.annotation import draw_tracks
from vdet.track.track import Track

HEIGHTS = [180, 240, 360, 480, 540, 720, 1080, 2160]


def blank(width: int = 320, height: int = 240) -> Image:
    return np.full((height, width, 3), 255, np.uint8)


def touched(image: Image) -> npt.NDArray[np.bool_]:
    """Tell which pixels of a picture that was `blank` have been drawn on."""
    return np.asarray((image != 255).any(axis=2))


def covered(box: Box, image: Image) -> npt.NDArray[np.bool_]:
    mask = np.zeros(image.shape[:2], bool)
    mask[max(0, box.y) : max(0, box.bottom), max(0, box.x) : max(0, box.right)] = True
    return mask


def shrunk(box: Box, margin: int) -> Box:
    return Box(box.x + margin, box.y + margin, box.width - 2 * margin, box.height - 2 * margin)


def letters(image: Image) -> int:
    """Count the dark pixels of a label's text; tags and pictures here are bright."""
    return int((image.max(axis=2) < 110).sum())


class TestBox:
    @pytest.mark.parametrize("height", HEIGHTS)
    def test_the_outline_lies_just_inside_the_box(self, height: int) -> None:
        image = blank(400, height)
        box = Box(50, 60, 100, 80)
        draw_box(image, box, (0, 0, 0))
        rows, columns = np.nonzero(touched(image))
        assert (columns.min(), rows.min()) == (box.x, box.y)
        assert (columns.max() + 1, rows.max() + 1) == (box.right, box.bottom)
        assert not (touched(image) & covered(shrunk(box, line_width(image) + 2), image)).any()

    @given(
        x=st.integers(-100, 340),
        y=st.integers(-100, 260),
        width=st.integers(10, 400),
        height=st.integers(10, 300),
        rows=st.sampled_from([180, 540, 720]),
    )
    def test_nothing_outside_the_box_is_touched_wherever_it_lies(
        self, x: int, y: int, width: int, height: int, rows: int
    ) -> None:
        image, box = blank(height=rows), Box(x, y, width, height)
        draw_box(image, box, (0, 0, 0))
        assert not (touched(image) & ~covered(box, image)).any()

    def test_of_a_box_partly_outside_the_frame_the_sides_inside_are_drawn(self) -> None:
        image = blank()
        draw_box(image, Box(-20, 100, 60, 50), (0, 0, 0))
        assert touched(image)[100, :40].all()
        assert touched(image)[149, :40].all()
        assert touched(image)[100:150, 39].all()
        assert not touched(image)[110:140, :30].any()

    def test_a_box_as_large_as_the_frame_is_seen_whole(self) -> None:
        image = blank()
        draw_box(image, Box(0, 0, 320, 240), (0, 0, 0))
        for side in (np.s_[0, :], np.s_[-1, :], np.s_[:, 0], np.s_[:, -1]):
            assert touched(image)[side].all()

    def test_lines_are_wider_on_larger_frames(self) -> None:
        widths = [line_width(blank(height=height)) for height in HEIGHTS]
        assert widths == sorted(widths)
        assert line_width(blank(height=720)) == 3
        assert min(widths) == 1


def flat(value: float) -> Heat:
    return Heat(np.full((24, 32), value, np.float32))


CORNERS = [(x, y) for x in (-50, 0, 160, 319, 400) for y in (-50, 0, 120, 239, 300)]


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

    def test_stands_on_its_corner(self) -> None:
        image = blank()
        draw_label(image, "#7", (100, 120), GREEN)
        rows, columns = np.nonzero(touched(image))
        assert columns.min() == 100
        assert rows.max() in (119, 120)

    def test_a_text_wider_than_the_picture_shows_its_beginning(self) -> None:
        image = blank(width=60)
        draw_label(image, "a very long label indeed", (50, 120), GREEN)
        assert touched(image)[:, 0].any()
        assert letters(image) > 10

    @pytest.mark.parametrize("x", [-30, 0, 250, 300])
    @pytest.mark.parametrize("y", [-30, 0, 200, 230])
    def test_of_a_box_at_the_edge_is_whole(self, x: int, y: int) -> None:
        middle, image = blank(), blank()
        draw_box(middle, Box(100, 100, 60, 60), GREEN, "#12")
        draw_box(image, Box(x, y, 60, 60), GREEN, "#12")
        assert letters(image) == letters(middle) > 5

    def test_stands_above_its_box_where_there_is_room(self) -> None:
        image, box = blank(), Box(100, 100, 60, 60)
        draw_box(image, box, GREEN, "#12")
        above = touched(image) & ~covered(box, image)
        assert above[80:100, 100:160].any()
        assert not above[101:].any()


class TestColor:
    def test_neighbouring_ids_differ_clearly(self) -> None:
        colors = [np.array(color_of(number)) for number in range(100)]
        pairs = [*itertools.pairwise(colors), *zip(colors, colors[2:], strict=False)]
        assert min(int(abs(a - b).max()) for a, b in pairs) > 100

    def test_is_bright_and_the_same_for_the_same_id(self) -> None:
        for number in range(50):
            assert max(color_of(number)) == 255
            assert color_of(number) == color_of(number)


class TestTracks:
    def test_only_boxes_and_their_labels_are_drawn_on(self) -> None:
        image = blank(1280, 720)
        boxes = [Box(200, 400, 120, 90), Box(800, 420, 240, 150)]
        draw_tracks(image, [Track(n, box, False) for n, box in enumerate(boxes, start=1)])
        allowed = np.zeros(image.shape[:2], bool)
        for box in boxes:
            allowed |= covered(Box(box.x, box.y - 32, box.width, box.height + 32), image)
        assert touched(image).any()
        assert not (touched(image) & ~allowed).any()
        for box in boxes:
            assert not (touched(image) & covered(shrunk(box, 5), image)).any()

    def test_each_id_has_its_own_color(self) -> None:
        image = blank()
        draw_tracks(image, [Track(3, Box(20, 100, 50, 50), False)])
        draw_tracks(image, [Track(4, Box(200, 100, 50, 50), False)])
        assert tuple(image[149, 45]) == color_of(3)
        assert tuple(image[149, 225]) == color_of(4)

    def test_no_tracks_leave_the_picture_as_it_was(self) -> None:
        image = blank()
        draw_tracks(image, [])
        assert not touched(image).any()


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
        image = blank(32, 24)
        blend_heat(image, flat(1))
        assert not touched(image).any()

"""The slow search: whole frame and parts, as they are and mirrored, joined to one box a vehicle."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
import pytest

from vdet.detect.detections import Detections
from vdet.geometry import Box
from vdet.learn.adapt.teacher import Teacher, parts_of
from vdet.media import Picture
from vdet.media.images import Image

WIDTH, HEIGHT = 640, 360


@dataclass
class Seer:
    """A detector that finds red things with one score; those lower than `least` pixels not."""

    score: float = 0.8
    least: int = 0
    sizes: list[tuple[int, int]] = field(default_factory=list)

    def for_video(self, width: int, height: int, images: Sequence[Image]) -> "Seer":  # noqa: ARG002
        self.sizes.append((width, height))
        return self

    def search(self, picture: Picture, index: int | None) -> Image:  # noqa: ARG002
        return picture.image

    def detect(self, candidates: Image) -> Detections:
        red: Image = (candidates[..., 2] > 128).astype(np.uint8)
        _, _, stats, _ = cv2.connectedComponentsWithStats(red)
        scale = HEIGHT / candidates.shape[0]
        boxes = [(x, y, x + w, y + h) for x, y, w, h, _ in stats[1:] if h * scale >= self.least]
        return Detections(boxes, [self.score] * len(boxes))

    def stage_pictures(self, image: Image, detections: Detections) -> dict[str, Image]:  # noqa: ARG002
        return {}


def frame(*boxes: Box) -> Image:
    image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    for box in boxes:
        image[box.y : box.bottom, box.x : box.right, 2] = 255
    return image


def find(seer: Seer, *boxes: Box) -> Detections:
    return Teacher(seer, WIDTH, HEIGHT).detect(frame(*boxes))


@pytest.mark.parametrize("x", [0, 20, 130, 300, 480, 600])
def test_each_vehicle_is_one_box_where_it_is(x: int) -> None:
    box = Box(x, 150, 40, 30)
    found = find(Seer(), box)
    assert found.rounded == [box]
    assert found.scores[0] == pytest.approx(0.8)


def test_several_vehicles_are_several_boxes() -> None:
    boxes = [Box(40, 150, 40, 30), Box(300, 140, 60, 40), Box(500, 160, 100, 70)]
    assert sorted(find(Seer(), *boxes).rounded, key=lambda box: box.x) == boxes


def test_nothing_is_found_in_an_empty_frame() -> None:
    assert len(find(Seer())) == 0


def test_a_vehicle_that_a_part_cuts_off_is_taken_from_others() -> None:
    half = WIDTH // 2
    assert find(Seer(), Box(half - 60, 150, 120, 60)).rounded == [Box(half - 60, 150, 120, 60)]


def test_a_small_vehicle_that_only_the_parts_show_keeps_their_score() -> None:
    small = Box(300, 150, 20, 16)
    found = find(Seer(least=20), small)
    assert found.rounded == [small]
    assert found.scores[0] == pytest.approx(0.8)


def test_parts_are_half_as_large_as_the_frame_and_lie_in_it() -> None:
    seer = Seer()
    find(seer)
    assert set(seer.sizes) == {(WIDTH, HEIGHT), (WIDTH // 2, HEIGHT // 2)}
    for part in parts_of(WIDTH, HEIGHT):
        assert 0 <= part.left < part.right <= WIDTH
        assert 0 <= part.top < part.bottom <= HEIGHT

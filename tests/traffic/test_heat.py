"""Where vehicles were."""

import numpy as np

from traffic.passing import HEIGHT, WIDTH, frame, track
from vdet.boxes import Box
from vdet.media.images import Image
from vdet.traffic.heat import HeatMap

STILL = np.full((HEIGHT, WIDTH, 3), (20, 90, 30), np.uint8)
PLACE = Box.sized(200, 100, 60, 80)


def heat(*boxes: Box, still: Image = STILL) -> Image:
    made = HeatMap(WIDTH, HEIGHT)
    for index, box in enumerate(boxes):
        made.add(frame(index, track(1, box)))
    return made.over(still)


def color(picture: Image) -> Image:
    """Return how much colour each pixel has."""
    return np.asarray(np.ptp(picture, axis=2), np.uint8)


def test_the_ground_under_a_vehicle_has_colour_and_nothing_else() -> None:
    seen = color(heat(PLACE))
    assert seen[PLACE.pixels[3] - 10, 230] > 60
    assert seen[PLACE.pixels[1] + 20, 230] < 10, "the roof is not where it stands"
    assert seen[:, :180].max() < 10


def test_it_lies_at_the_same_place_over_a_still_of_any_size() -> None:
    small = color(heat(PLACE, still=np.ascontiguousarray(STILL[::2, ::2])))
    assert small.shape == (HEIGHT // 2, WIDTH // 2)
    assert small[(PLACE.pixels[3] - 10) // 2, 115] > 60


def test_boxes_that_reach_beyond_the_frame_count_as_far_as_it_goes() -> None:
    heat(
        Box.sized(-50, -40, 30, 20),
        Box.sized(WIDTH - 5, HEIGHT - 5, 50, 50),
        Box.sized(-10, 20, 9000, 9000),
    )

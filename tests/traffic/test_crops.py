"""The best image of each vehicle."""

import numpy as np

from traffic.passing import HEIGHT, WIDTH, frame, track
from vdet.boxes import Box, Image
from vdet.media import Picture
from vdet.track.track import Track
from vdet.traffic.records import BestCrops, Crop

ROAD = np.arange(HEIGHT * WIDTH * 3, dtype=np.uint64).reshape(HEIGHT, WIDTH, 3).astype(np.uint8)
IMAGE = Picture(ROAD)


def crops(*shown: list[Track]) -> dict[int, Crop]:
    """Return the picture of each vehicle that was given back last."""
    best = BestCrops()
    found = [crop for n, track in enumerate(shown) for crop in best.add(frame(n, *track), IMAGE)]
    return {crop.id: crop for crop in (*found, *best.end())}


def box(size: int, x: int = 50) -> Box:
    return Box.sized(x, 60, size, size)


def cut(place: Box) -> Image:
    """Return a place with a tenth of its size around it."""
    x, y = round(place.width / 10), round(place.height / 10)
    return Box(place.x1 - x, place.y1 - y, place.x2 + x, place.y2 + y).cut(ROAD)


def test_the_largest_is_taken_and_shows_the_box() -> None:
    found = crops([track(1, box(40))], [track(1, box(50))], [track(1, box(45))])
    np.testing.assert_array_equal(found[1].image, cut(box(50)))
    assert found[1].time == 1 / 25


def test_what_is_whole_in_the_frame_is_better_than_what_is_larger() -> None:
    at_the_edge = Box.sized(WIDTH - 90, 60, 90, 90)
    found = crops([track(1, box(40))], [track(1, at_the_edge)])
    assert found[1].image.shape == (48, 48, 3)
    alone = crops([track(1, at_the_edge)])
    assert alone[1].image.shape == (108, 99, 3), "it is better than nothing"


def test_where_the_detector_did_not_see_it_there_is_no_picture() -> None:
    assert crops([track(1, box(40), state="predicted")]) == {}


def test_a_vehicle_that_is_gone_is_given_back_and_again_if_it_comes_back_better() -> None:
    best = BestCrops()
    assert best.add(frame(0, track(1, box(40))), IMAGE) == []
    assert [crop.id for crop in best.add(frame(1), IMAGE)] == [1]
    assert best.add(frame(2), IMAGE) == []
    assert best.add(frame(3, track(1, box(30))), IMAGE) == []
    assert best.add(frame(4), IMAGE) == [], "the first one is better"
    best.add(frame(5, track(1, box(60))), IMAGE)
    assert [crop.image.shape[0] for crop in best.end()] == [72]

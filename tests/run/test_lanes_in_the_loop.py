"""The lane, found in the same stream of frames as the vehicles."""

import weakref
from collections.abc import Callable

import pytest

from red_cars import HEIGHT, WIDTH, drive
from run.red_runs import follow
from vdet.lanes.camera import CalibratedCamera, Undistorter
from vdet.lanes.road import LaneRequest
from vdet.media.images import Image

LENS = CalibratedCamera(
    WIDTH, HEIGHT, ((240, 0, 160), (0, 240, 120), (0, 0, 1)), (-0.35, 0.1, 0.0, 0.0, 0.0), 0.4
)
COUNT = 40


def test_vehicles_are_searched_in_the_original_frame() -> None:
    with_lanes = follow(drive(15), lanes=LaneRequest(LENS))
    without = follow(drive(15))
    for one, other in zip(with_lanes, without, strict=True):
        assert one.tracks == other.tracks
        assert (one.frame.image == other.frame.image).all()


@pytest.mark.parametrize("threads", [1, 3])
def test_few_undistorted_frames_are_in_memory_at_a_time(
    monkeypatch: pytest.MonkeyPatch, threads: int
) -> None:
    made: list[weakref.ref[Image]] = []

    def watched(undistort: Callable[[Undistorter, Image], Image]) -> Callable[..., Image]:
        def image(self: Undistorter, frame: Image) -> Image:
            undistorted = undistort(self, frame)
            made.append(weakref.ref(undistorted))
            return undistorted

        return image

    monkeypatch.setattr(Undistorter, "image", watched(Undistorter.image))
    most = 0
    for _ in follow(drive(COUNT), threads=threads, lanes=LaneRequest(LENS)):
        most = max(most, sum(image() is not None for image in made))
    assert len(made) == COUNT
    assert 0 < most <= threads + 3

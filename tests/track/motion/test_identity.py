"""An id is one vehicle: drawn scenes in which places alone would mix vehicles up."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import pytest

from track.motion.scenes import HEIGHT, RATE, WIDTH, detections
from vdet.boxes import Box
from vdet.config.schema import MotionTrackerSettings
from vdet.draw import Color
from vdet.media import Picture
from vdet.media.frame import Coding, Planes
from vdet.track.motion.tracker import MotionTracker, appearances, differences

RED, WHITE, SILVER, GREY, BLUE = (
    (40, 30, 180), (230, 230, 230), (175, 172, 170), (95, 95, 95), (150, 70, 30),
)  # fmt: skip
SETTINGS = MotionTrackerSettings()
SECONDS = 3
STRIDE = 2
"""Every second frame is searched, as by default at 25 frames a second."""

Times = tuple[float, float]


@dataclass(frozen=True)
class Painted:
    """A vehicle of one colour. It is detected from `begin` to `end`, but not while it is hidden."""

    color: Color
    at: Callable[[float], Box]
    begin: float = 0.0
    end: float = SECONDS
    hidden: Times = (SECONDS, SECONDS)

    def is_seen(self, time: float) -> bool:
        is_hidden = self.hidden[0] <= time < self.hidden[1]
        return self.begin <= time < self.end and not is_hidden

    def visible(self, time: float) -> Box:
        return self.at(time).clipped(WIDTH, HEIGHT)


def moving(x: float, y: float, width: float, dx: float, dy: float = 0) -> Callable[[float], Box]:
    """Give the box of a vehicle by its middle at time 0 and its velocity, pixels a second."""
    return lambda time: Box.sized(x + dx * time - width / 2, y + dy * time, width, 0.7 * width)


def turning_off(time: float) -> Box:
    """Return the box of a vehicle that drives to the right, and then slowly to the left."""
    return moving(min(500 + 120 * time, 720 - 50 * time), 400, 100, 0)(time)


def picture(vehicles: Sequence[Painted], time: float) -> Picture:
    image = np.full((HEIGHT, WIDTH, 3), (88, 104, 92), np.uint8)
    for vehicle in vehicles:  # the nearest last
        left, top, right, bottom = vehicle.visible(time).pixels
        cv2.rectangle(image, (left, top), (right - 1, bottom - 1), vehicle.color, cv2.FILLED)
    return Picture(image)


def ids_of(vehicles: Sequence[Painted]) -> list[set[int]]:
    """Return the ids under which each vehicle is shown while it is detected."""
    tracker = MotionTracker(SETTINGS, WIDTH, HEIGHT)
    ahead = round(SETTINGS.look_ahead * RATE)
    ids: list[set[int]] = [set() for _ in vehicles]
    for number in range(SECONDS * RATE + ahead):
        time = number / RATE
        if number < SECONDS * RATE and number % STRIDE == 0:
            found = [vehicle.visible(time) for vehicle in vehicles if vehicle.is_seen(time)]
            tracker.observe(detections(found), time, picture(vehicles, time))
        if number >= ahead:
            add_shown(tracker, (number - ahead) / RATE, vehicles, ids)
    return ids


def add_shown(
    tracker: MotionTracker, time: float, vehicles: Sequence[Painted], ids: list[set[int]]
) -> None:
    for track in tracker.at(time):
        overlaps = [
            vehicle.is_seen(time) * track.box.iou(vehicle.visible(time)) for vehicle in vehicles
        ]
        if max(overlaps) > 0.5:
            ids[int(np.argmax(overlaps))].add(track.id)


SCENES = {
    "an oncoming van is lost, and a car that drives away comes in near by": (
        Painted(WHITE, moving(640, 300, 100, -60, 60), end=1.0),
        Painted(GREY, moving(760, 420, 110, -40, -60), begin=1.2),
    ),
    "a car drives away slowly and is lost, and one of its colour comes near there": (
        Painted(SILVER, moving(640, 400, 100, 0, -40), end=1.0),
        Painted(SILVER, moving(640, 312, 100, 0, 35), begin=1.4),
    ),
    "a car is lost while it turns off": (Painted(SILVER, turning_off, hidden=(1.0, 1.6)),),
    "a red car is lost beside a white one that was not seen before": (
        Painted(RED, moving(500, 400, 90, 40), end=1.4),
        Painted(WHITE, moving(610, 405, 90, 40), begin=1.4),
    ),
    "a lorry hides a silver car for a second": (
        Painted(SILVER, moving(300, 380, 80, 150), hidden=(1.0, 2.0)),
        Painted(BLUE, moving(900, 330, 300, -300)),
    ),
    "a car overtakes one of its own colour": (
        Painted(SILVER, moving(300, 390, 80, 120), hidden=(1.4, 1.9)),
        Painted(SILVER, moving(200, 410, 100, 200)),
    ),
    "two cars cross": (
        Painted(RED, moving(300, 380, 90, 200), hidden=(1.2, 1.8)),
        Painted(BLUE, moving(900, 410, 110, -200)),
    ),
    "cars of the same colour stand side by side": (
        Painted(SILVER, moving(400, 400, 90, 0)),
        Painted(SILVER, moving(490, 402, 90, 0)),
    ),
}


@pytest.mark.parametrize("vehicles", SCENES.values(), ids=SCENES.keys())
def test_each_vehicle_has_one_id_of_its_own(vehicles: tuple[Painted, ...]) -> None:
    ids = ids_of(vehicles)
    assert [len(item) for item in ids] == [1] * len(vehicles)
    assert len(set.union(*ids)) == len(vehicles)


def test_appearances_are_the_mean_colours_of_the_halves_of_an_image_or_of_planes() -> None:
    image = np.zeros((60, 80, 3), np.uint8)
    image[10:30, 20:60], image[30:50, 20:60] = RED, WHITE
    boxes = np.array([[20.0, 10, 60, 50]])
    [[upper, lower]] = appearances(Picture(image), boxes)
    assert upper == pytest.approx([76, 107, 202], abs=1)  # OpenCV's BGR to YCrCb
    assert lower == pytest.approx([230, 128, 128], abs=1)
    [planes] = appearances(Picture(Planes.of_image(image, Coding(full_range=True))), boxes)
    assert np.array([upper, lower]) == pytest.approx(planes, abs=3)
    assert differences(upper[np.newaxis], lower[np.newaxis]) > 3
    [unknown] = appearances(None, boxes)
    assert differences(unknown, planes) == 0

"""Zones: entries, exits, presence and time inside."""

import pytest

from traffic.scenes import (
    HEIGHT,
    LINE,
    WIDTH,
    ZONE,
    Path,
    counts,
    events,
    frames,
    joined,
    numbered,
    settings_for,
    through,
)
from vdet.config.scene import ZoneSettings
from vdet.traffic.counter import VehicleCounter

ACROSS = through((0, 200, 400), (8, 1000, 400))  # 100 pixels a second; in from 2 s to 6 s


CORNER = ZoneSettings(name="zone", points=((800, 500), (1279, 500), (1279, 719), (800, 719)))
WHOLE = ZoneSettings(name="zone", points=((0, 0), (1280, 0), (1280, 720), (0, 720)))
VISITS: dict[str, tuple[Path, ZoneSettings, list[tuple[str, float | None]]]] = {
    "drives through": (ACROSS, ZONE, [("enter", None), ("exit", 4)]),
    "is first seen inside": (
        through((0, 600, 400), (4, 1000, 400)), ZONE, [("appear", None), ("exit", 2)],
    ),
    "is lost just before it": (
        through((0, 600, 200), (2, 600, 295)), ZONE, [("enter", None), ("vanish", 0)],
    ),
    "is cut off by the frame, its foot below": (
        through((0, 900, 300), (4, 1100, HEIGHT + 80), (6, WIDTH + 90, HEIGHT + 200)),
        CORNER, [("enter", None), ("vanish", 4.4)],
    ),
    "drives through the whole frame, which has no border": (
        ACROSS, WHOLE, [("appear", None), ("vanish", 8)],
    ),
}  # fmt: skip


@pytest.mark.parametrize("vehicle", VISITS)
def test_a_vehicle_has_events_at_a_zone(vehicle: str) -> None:
    path, zone, expected = VISITS[vehicle]
    found = events(frames(path, seconds=8), zone)
    assert [(e.direction, e.seconds and round(e.seconds, 2)) for e in found] == expected


def test_a_new_id_inside_goes_on_with_the_stay() -> None:
    old = frames(through((0, 200, 400), (3.9, 590, 400)), seconds=4)
    new = numbered(frames(through((4.1, 610, 400), (8, 1000, 400))), 2)
    found = events(joined(old, new), ZONE)
    assert [(event.id, event.direction) for event in found] == [(1, "enter"), (2, "exit")]
    assert found[1].seconds == pytest.approx(4, abs=0.02)


PARKED = through((0, 600, 400), (3, 612, 404), (7, 590, 398), (10, 604, 402))  # its box trembles


def test_a_vehicle_that_stands_the_whole_time_is_not_counted_and_one_that_parks_is_one_visit() -> (
    None
):
    visit = through((0, 200, 420), (2, 700, 420), (7, 702, 421), (9, 1000, 420))
    found = counts(frames(PARKED, visit), ZONE, LINE)
    assert [(event.vehicle, event.direction) for event in found.events] == [
        (2, "enter"),
        (2, "exit"),
    ]
    [flow] = [row for row in found.flows() if row.count]
    assert (flow.origin, flow.destination) == ("zone", None)
    [use] = found.zone_use()
    assert (use.entered, use.left, use.max) == (1, 1, 1)
    assert found.warnings == counts(frames(visit), ZONE, LINE).warnings


def test_a_vehicle_that_stands_is_counted_in_a_run_as_soon_as_it_drives() -> None:
    path = through((0, 600, 400), (4, 604, 402), (8, 1000, 400))
    counter = VehicleCounter(settings_for(ZONE), WIDTH, HEIGHT)
    appeared = []
    for frame in frames(path, seconds=7):
        counter.update(frame)
        appeared.append(counter.so_far()["zone", "appear"])
    assert appeared[: 4 * 25] == [0] * 100
    assert appeared[-1] == 1
    assert counter.counts().events[0].time == 0


def test_a_vehicle_is_in_one_of_two_zones_side_by_side() -> None:
    left = ZoneSettings(name="left", points=((0, 0), (640, 0), (640, 720), (0, 720)))
    right = ZoneSettings(name="right", points=((640, 0), (1280, 0), (1280, 720), (640, 720)))
    found = events(frames(ACROSS), left, right)
    assert [(event.name, event.direction) for event in found if event.time < 8] == [
        ("left", "appear"), ("left", "exit"), ("right", "enter"),
    ]  # fmt: skip
    assert found[1].time == found[2].time


def test_stays_follow_from_the_events() -> None:
    later = through((1, 200, 420), (9, 1000, 420))
    last = through((5.5, 900, 380), (9, 450, 380))
    (stay,) = counts(frames(ACROSS, later, last, seconds=9), ZONE).zone_use()
    assert stay.max == 2
    assert stay.max_stay == pytest.approx(4, abs=0.01)
    assert stay.mean_stay == pytest.approx((4 + 4 + 9 - (5.5 + 3.5 * 100 / 450)) / 3, abs=0.01)

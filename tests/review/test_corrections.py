"""Corrections of counts: their files, what follows from them, and what does not fit."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from traffic.scenes import (
    HEIGHT,
    LINE,
    WIDTH,
    ZONE,
    frames,
    joined,
    named,
    numbered,
    settings_for,
    through,
)
from vdet.errors import ConfigError
from vdet.labels.label import SourceVideo
from vdet.review.corrections import Corrections, apply_corrections, by_video
from vdet.review.estimate import estimate
from vdet.traffic.counting import count_frames
from vdet.traffic.counts import ALL, Counts, Event, VehicleGroup

SECOND = LINE.model_copy(update={"name": "second", "start": (200, 300), "end": (1000, 300)})
SIZE = WIDTH, HEIGHT
SETTINGS = settings_for(LINE.model_copy(update={"approach": "N"}), SECOND, ZONE)
BORDERS = [
    {"name": one.name, "start": [*one.start], "end": [*one.end], "left": "away", "right": "here"}
    for one in (LINE, SECOND)
]
ZONES = [{"name": "zone", "points": [[*point] for point in ZONE.points]}]


def counts() -> Counts:
    """Two cars come at 2 s and 6 s, cross both lines, and the first enters the zone."""
    video = joined(
        frames(through((1, 500, 200), (4, 500, 700)), seconds=10),
        numbered(frames(through((5, 900, 200), (8, 900, 700)), seconds=10), 2),
    )
    return count_frames(named(video, "car"), SETTINGS, SIZE)


def saved(path: Path, *events: dict[str, Any], **values: Any) -> Path:
    """Write a file of corrections."""
    given = {"video": "in.mp4", "size": [*SIZE], "lines": BORDERS, "events": [*events]} | values
    path.write_text(yaml.safe_dump(given))
    return path


def error(
    event: Event, kind: str | None, correct: str | None = None, **values: Any
) -> dict[str, Any]:
    """Return what a reviewer says of an event; an error of None: it was counted rightly."""
    told = {"line": event.name, "time": round(event.time, 2), "direction": event.direction}
    told |= {"class": event.class_name, "id": event.id, "error": kind}
    return told | ({"correct": correct} if correct else {}) | values


def missed(time: float, class_name: str = "bus") -> dict[str, Any]:
    """Return a vehicle that a reviewer added at the first line."""
    where = {"line": "line", "time": time, "direction": "away"}
    return where | {"class": class_name, "error": "missed"}


def corrected(counted: Counts, *paths: Path, classes: tuple[str, ...] = ()) -> Counts:
    """Apply files of corrections to the counts of a video."""
    traffic = SETTINGS.traffic.for_frames(*SIZE)
    settings = SETTINGS.model_copy(update={"classes": classes, "traffic": traffic})
    reviews = [Corrections.read(path) for path in paths]
    return apply_corrections({"": counted}, reviews, settings)[""]


def events_of(counted: Counts, name: str) -> list[Event]:
    return [event for event in counted.events if event.name == name]


def ways(counted: Counts) -> list[tuple[str, str, str | None]]:
    return [(one.name, one.direction, one.class_name) for one in counted.events]


def test_events_are_removed_added_renamed_and_turned(tmp_path: Path) -> None:
    before = counts()
    (first, second), (_, last) = events_of(before, "line"), events_of(before, "second")
    path = saved(
        tmp_path / "c.yaml",
        error(first, "class", "lorry"),
        error(second, "direction", "away"),
        missed(8.5),
        error(last, "false"),
    )
    after = corrected(before, path)
    assert [one[1:] for one in ways(after) if one[0] == "line"] == [
        ("here", "truck"), ("away", "car"), ("away", "bus"),
    ]  # fmt: skip
    assert [one for one in ways(after) if one[0] == "second"] == [("second", "here", "truck")]
    assert {one.class_name for one in events_of(after, "zone")} == {"truck"}
    assert str(after.corrected) == "corrected: 7 events, by c.yaml; minutes checked: 0 of 0.17"
    flows = [(row.origin, row.destination, row.class_name) for row in after.flows() if row.count]
    assert flows == [
        ("line", None, "bus"), ("line", None, "car"), ("second", "line", "truck"),
    ]  # fmt: skip
    trucks = corrected(before, path, classes=("truck", "bus"))
    assert ways(trucks) == [way for way in ways(after) if way[2] != "car"]


def test_a_vehicle_that_another_run_does_not_miss_is_not_added(tmp_path: Path) -> None:
    before = counts()
    events = [error(event, None) for event in before.events if event.name != "zone"]
    path = saved(tmp_path / "c.yaml", *events, missed(8.5), missed(8.6))
    assert len(corrected(before, path).events) == len(before.events) + 2
    better = replace(before.events[0], time=8.2, name="line", direction="away", vehicle=9, id=9)
    rerun = replace(before, events=(*before.events, better))
    after = corrected(rerun, path)
    assert ways(after)[-2:] == [("line", "away", "bus"), ("line", "away", "bus")]
    assert after.corrected
    assert len(after.corrected.corrections) == 2
    assert ways(corrected(rerun, saved(tmp_path / "c.yaml", missed(8.5)))) == [
        (one.name, one.direction, "bus" if one is better else "car") for one in rerun.events
    ]


def test_the_class_and_the_direction_of_one_event_are_one_correction(tmp_path: Path) -> None:
    first = events_of(counts(), "line")[0]
    car = replace(first, time=70.0, direction="away", id=1, vehicle=1)
    bus = replace(first, time=70.28, direction="here", id=2, vehicle=2, class_name="bus")
    video = replace(counts(), events=(car, bus), spans=((0.0, 100.0),))
    both = error(car, None) | {"error": ["class", "direction"], "correct": ["truck", "here"]}
    for neighbours in ([], [error(bus, None)]):
        path = saved(tmp_path / "c.yaml", both, *neighbours)
        after = corrected(video, path)
        assert [(one.id, *way[1:]) for one, way in zip(after.events, ways(after), strict=True)] == [
            (1, "here", "truck"), (2, "here", "bus"),
        ]  # fmt: skip
    for wrong in ({"error": ["class", "false"]}, {"correct": "truck"}, {"error": "class"}):
        with pytest.raises(ConfigError, match="error: "):
            Corrections.read(saved(tmp_path / "c.yaml", {**both, "correct": [], **wrong}))


def test_checked_minutes_of_a_sample_say_how_many_passed_in_all(tmp_path: Path) -> None:
    """As files of vdet 1.1 have them: no list, and the first frame is at 1.5 s."""
    first = events_of(counts(), "line")[0]
    cars = [replace(first, time=148.5 + 60.0 * n, id=n, vehicle=n) for n in range(10)]
    video = replace(counts(), events=tuple(cars), spans=((120.0, 719.9),))
    checked = [{"line": line, "start": 121.5, "end": 301.5} for line in ("line", "second")]
    checked.append({"line": "line", "start": 361.5, "end": 421.5})
    values = {"start": 1.5, "sample": {"seed": 1, "minutes": [4, 2, 3]}, "checked": checked}
    path = saved(tmp_path / "c.yaml", missed(190), error(cars[5], "false", time=450.0), **values)
    after = corrected(video, path).corrected
    assert after
    assert str(after).startswith(
        "corrected: 2 events, by c.yaml; minutes checked: 3 of 10; at checked lines 10 counted, "
        "10 corrected, 1"
    )
    here, away = VehicleGroup("line", "here"), VehicleGroup("line", "away")
    car, bus = VehicleGroup(class_name="car"), VehicleGroup(class_name="bus")
    second = VehicleGroup("second", "away"), VehicleGroup("second", "here")
    none, one = np.zeros((3, 10), np.int64), np.ones(10, np.int64)
    numbers = {group: none.copy() for group in (ALL, away, here, *second, car, bus)}
    for group in (ALL, here, car):
        numbers[group][0] = one
        numbers[group][2, 5] = 1  # a false one
    for group in (ALL, away, bus):
        numbers[group][1, 1] = 1  # a missed one
    by_group = {item.group: item for item in after.estimates}
    exact = estimate(numbers, checked=range(3), drawn=range(3))
    assert by_group == {item.group: item for item in exact}
    path = saved(tmp_path / "c.yaml", missed(190), start=1.5)
    unchecked = corrected(video, path).corrected
    assert unchecked
    assert (unchecked.checked, unchecked.estimates) == ((), ())


def test_half_a_second_is_near_enough_after_another_run(tmp_path: Path) -> None:
    before = counts()
    event = events_of(before, "line")[0]
    near = saved(tmp_path / "near.yaml", error(event, "false", time=event.time + 0.4, id=99))
    assert len(corrected(before, near).events) == len(before.events) - 1
    far = saved(tmp_path / "far.yaml", error(event, "false", time=event.time + 0.6))
    with pytest.raises(ConfigError, match=r"far\.yaml: line, .* s, here, car: no such event"):
        corrected(before, far)


def test_a_file_for_another_video_or_line_is_rejected(tmp_path: Path) -> None:
    begin = datetime(2026, 5, 1, 7, tzinfo=UTC)
    known = SourceVideo("a/in.mp4", *SIZE, length=10.0, begin=begin)

    def check(source: SourceVideo | None = known, **values: Any) -> None:
        video = replace(counts(), source=source)
        corrected(video, saved(tmp_path / "c.yaml", **values))

    check()
    check(None)
    twice = {**BORDERS[0], "start": [400, 800], "end": [2000, 800]}
    check(None, size=[2 * side for side in SIZE], lines=[twice])
    check(lines=[{**BORDERS[0], "start": [200.8, 400]}])
    for name in ("in.mp4", "a/in.mp4", "/data/a/in.mp4"):
        check(video=name, length=10.4, begin="2026-05-01T09:00:00+02:00")
    for name in ("other.mp4", "b/in.mp4"):
        with pytest.raises(ConfigError, match=r"c\.yaml: corrects .*, .* videos: a/in\.mp4"):
            check(video=name)
    for values, fault in (
        ({"size": [2560, 1440], "lines": [twice]}, "frames of 1280×720, not 2560×1440"),
        ({"length": 20.0}, r"a length of 10\.0 s, not 20\.0 s"),
        ({"begin": "2026-05-02T07:00:00+00:00"}, "the beginning 2026-05-01 07:00:00"),
    ):
        with pytest.raises(ConfigError, match=rf"corrects another in\.mp4: this one has {fault}"):
            check(**values)
    for wrong in ({"start": [203, 400]}, {"left": "off"}, {"name": "new"}):
        with pytest.raises(ConfigError, match="is not where these settings have it"):
            check(lines=[{**BORDERS[0], **wrong}])
    with pytest.raises(ConfigError, match=r"c\.yaml: size: points are for frames of 1280×720"):
        check(None, size=[720, 720], lines=[{**BORDERS[0], "end": [700, 400]}])


def test_two_reviewers_are_merged_unless_they_contradict_each_other(tmp_path: Path) -> None:
    before = counts()
    first, second = events_of(before, "line")

    def merged(*events: dict[str, Any], checked: bool = False) -> Counts:
        span = [{"line": "line", "start": 0, "end": 10}] if checked else []
        a = saved(tmp_path / "a.yaml", error(first, "class", "bus"), error(second, "false"))
        b = saved(tmp_path / "b.yaml", *events, checked=span)
        return corrected(before, a, b)

    both = merged(error(first, "class", "bus"), error(second, "false"), checked=True)
    text = "corrected: 5 events, by a.yaml, b.yaml; minutes checked: 0.17 of 0.17; "
    assert str(both.corrected).startswith(text)
    assert merged().events == both.events
    contradictions = (
        ([error(first, "class", "truck")], False),
        ([error(first, None)], False),
        ([error(first, "false")], True),
        ([error(first, "class", "bus")], True),
    )
    for events, checked in contradictions:
        with pytest.raises(ConfigError, match=r"a\.yaml and .*b\.yaml: contradict .*: line, "):
            merged(*events, checked=checked)


def test_several_videos_are_corrected_by_the_files_that_name_them(tmp_path: Path) -> None:
    """The car of a.mp4 drives on in b.mp4, where a reviewer says what it is."""
    car = replace(counts().events[0], name="line", id=1, vehicle=1)
    other_car = replace(car, vehicle=2)
    ways_of_line = (("line", "here"), ("line", "away"))
    videos = {
        "a": Counts((car,), ways_of_line, (), spans=((0.0, 10.0),)),
        "b": Counts((replace(car, time=1.0), other_car), ways_of_line, (), spans=((0.0, 10.0),)),
    }
    files = [
        saved(tmp_path / "1.yaml", missed(8.5), video="a.mp4"),
        saved(tmp_path / "2.yaml", missed(8.5), video="b.mp4"),
        saved(tmp_path / "3.yaml", error(videos["b"].events[0], "class", "bus"), video="b.mp4"),
    ]
    counted = {
        key: replace(video, source=SourceVideo(f"{key}.mp4", *SIZE))
        for key, video in videos.items()
    }
    reviews = [Corrections.read(path) for path in files]
    after = apply_corrections(counted, reviews, SETTINGS)
    assert [(one.class_name, one.vehicle) for one in after["a"].events] == [("bus", 1), ("bus", 3)]
    assert [(one.class_name, one.vehicle) for one in after["b"].events] == [
        ("bus", 1), ("car", 2), ("bus", 4),
    ]  # fmt: skip
    assert [str(video.corrected) for video in after.values()] == [
        "corrected: 2 events, by 1.yaml; minutes checked: 0 of 0.17",
        "corrected: 2 events, by 2.yaml, 3.yaml; minutes checked: 0 of 0.17",
    ]  # fmt: skip
    for wrong in ({"a": "a.mp4"}, {"a": "a.mp4", "b": "a.mp4"}, {"a": None, "b": None}):
        sources = {key: SourceVideo(name, *SIZE) if name else None for key, name in wrong.items()}
        with pytest.raises(ConfigError, match=r"[123]\.yaml: corrects .*, which must be"):
            by_video(reviews, sources, SETTINGS.traffic)


def test_mistakes_have_a_position(tmp_path: Path) -> None:
    path = tmp_path / "c.yaml"
    text = "video: in.mp4\nsize: [1280, 720]\nevents:\n"
    text += "  - {line: a, time: 1, direction: x, error: bad}\n"
    path.write_text(text)
    with pytest.raises(
        ConfigError, match=r"c\.yaml:4:\d+: events\[0\]\.error\[0\]: must be 'false'"
    ):
        Corrections.read(path)
    path.write_text(text.replace("bad", "false"))
    with pytest.raises(ConfigError, match="events: a has no direction x"):
        Corrections.read(path)

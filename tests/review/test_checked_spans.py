"""Checked spans: their counts are the list of the reviewer, whatever a run found there."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from benchmarks.corrections import by_class, classified, damaged, other_runs, review
from benchmarks.pole_cameras import HEIGHT as POLE_HEIGHT
from benchmarks.pole_cameras import WIDTH as POLE_WIDTH
from benchmarks.pole_cameras import pole_scene

from review.test_corrections import (
    BORDERS,
    ZONES,
    corrected,
    counts,
    error,
    events_of,
    missed,
    saved,
    ways,
)
from vdet.errors import ConfigError
from vdet.review.corrections import apply_corrections
from vdet.traffic.counting import count_frames
from vdet.traffic.counts import ALL, Counts, Estimate, Event, VehicleGroup


def spans(*lines: str, start: float = 0.0, end: float = 11.0) -> list[dict[str, Any]]:
    """Return complete spans of lines."""
    return [{"line": line, "start": start, "end": end, "complete": True} for line in lines]


def at_lines(*events: Event) -> Counts:
    """Return counts of 100 s with these events."""
    return replace(counts(), events=events, spans=((0.0, 100.0),))


def estimate_of(after: Counts, group: VehicleGroup) -> tuple[float, ...]:
    """Return what was counted, is corrected, and the interval of a group."""
    assert after.corrected
    [item] = [item for item in after.corrected.estimates if item.group == group]
    return item.counted, item.corrected, item.low, item.high


@pytest.mark.parametrize("seed", [1, 2])
def test_any_other_run_has_the_counts_of_the_list(seed: int) -> None:
    scene = pole_scene("two streams", 10.0, seed=1)
    video, size = classified(scene, seed), (POLE_WIDTH, POLE_HEIGHT)
    truth = count_frames(video, scene.settings, size)
    counted = count_frames(damaged(video, seed), scene.settings, size)
    made = review(truth, counted, scene.settings)
    for kind, run in other_runs(video, counted, scene.settings, seed).items():
        assert by_class(run) != by_class(truth) or kind == "ids renumbered"
        after = apply_corrections({"": run}, [made], scene.settings)[""]
        assert by_class(after) == by_class(truth), kind
        assert after.corrected
        true = len(truth.events)
        total = Estimate(ALL, len(run.events), true, true, true, true, minutes_to_precision=0)
        assert after.corrected.estimates[0] == total


def test_a_listed_vehicle_keeps_the_path_of_the_run_and_an_added_one_has_none(
    tmp_path: Path,
) -> None:
    car, bus = events_of(counts(), "line")
    events = [error(car, None, **{"class": "truck"}), error(bus, None)]
    path = saved(tmp_path / "c.yaml", *events, missed(8.5), checked=spans("line"))
    run = at_lines(replace(car, time=car.time + 0.3, id=70, vehicle=70, speed=50.0))
    after = corrected(run, path)
    first, second, added = after.events
    truck = replace(car, time=round(car.time, 2), id=70, vehicle=70, class_name="truck", speed=50.0)
    assert first == truck
    assert [(one.id, one.frame, one.score, one.source) for one in (second, added)] == [
        (-1, -1, None, "reviewer")
    ] * 2
    assert len({one.vehicle for one in after.events}) == 3
    assert [(row.origin, row.destination) for row in after.flows() if row.count] == [
        ("line", None), ("line", None), ("line", None),
    ]  # fmt: skip
    assert corrected(run, saved(path, *events, missed(8.5))).events[0].class_name == "car", (
        "no list"
    )


def test_a_span_ends_where_the_reviewer_saw_the_vehicle(tmp_path: Path) -> None:
    """One passes just before 10 s, one just after; the run has both before."""
    [one, *_] = events_of(counts(), "line")
    before, after = replace(one, time=9.8), replace(one, time=10.2, id=2, vehicle=2)
    listed = [error(before, None), error(after, None)]
    path = saved(tmp_path / "c.yaml", *listed, checked=spans("line", end=10.0))
    run = at_lines(replace(before, time=9.85, id=8), replace(after, time=9.95, id=9))
    assert [event.time for event in corrected(run, path).events] == [9.8, 10.2]
    ghost = replace(one, time=9.0, id=3, vehicle=3)
    outside = replace(one, time=11.0, id=4, vehicle=4)
    times = [event.time for event in corrected(at_lines(ghost, before, outside), path).events]
    assert times == [9.8, 11.0]


def test_a_vehicle_has_its_class_at_all_lines_also_in_the_estimate(tmp_path: Path) -> None:
    before = counts()
    first, second = (events_of(before, name)[0] for name in ("line", "second"))
    assert first.vehicle == second.vehicle
    events = [error(first, "class", "truck"), error(second, None)]
    listed = [
        error(event, None) for name in ("line", "second") for event in events_of(before, name)[1:]
    ]
    path = saved(tmp_path / "c.yaml", *events, *listed, checked=spans("line", "second"))
    after = corrected(before, path)
    assert [way for way in ways(after) if way[2] == "truck"] == [
        ("second", "here", "truck"), ("zone", "enter", "truck"),
        ("line", "here", "truck"), ("zone", "exit", "truck"),
    ]  # fmt: skip
    assert estimate_of(after, VehicleGroup(class_name="truck")) == (0, 2, 2, 2)


def test_errors_where_nobody_checked_change_counts_but_not_the_estimate(tmp_path: Path) -> None:
    before = counts()
    listed = [error(event, None) for event in events_of(before, "line")]
    false = [error(event, "false") for event in events_of(before, "zone")]
    path = saved(tmp_path / "c.yaml", *listed, *false, checked=spans("line"), zones=ZONES)
    after = corrected(before, path)
    assert not events_of(after, "zone")
    assert estimate_of(after, ALL) == (2, 2, 2, 2)


def test_both_ends_of_a_visit_to_a_zone_are_false_and_occupancy_is_empty_if_unbalanced(
    tmp_path: Path,
) -> None:
    before = counts()
    enter, leave = events_of(before, "zone")
    path = saved(tmp_path / "c.yaml", error(enter, "false"), zones=ZONES)
    after = corrected(before, path)
    assert not events_of(after, "zone")
    turned = saved(path, error(enter, "direction", "exit"), zones=ZONES)
    unbalanced = corrected(before, turned)
    [row] = unbalanced.zone_use()
    assert (row.entered, row.left, (row.mean, row.max)) == (0, 2, (None, None))
    assert [finding.text.partition(":")[0] for finding in unbalanced.findings] == ["zone"]
    [row] = before.zone_use()
    assert (row.entered, row.left, row.max) == (1, 1, 1)
    assert leave.seconds


def test_events_outside_the_counted_part_are_an_error_that_names_them(tmp_path: Path) -> None:
    for time_of in (900_000.0, 1e300, -5.0):
        path = saved(tmp_path / "c.yaml", missed(time_of))
        with pytest.raises(ConfigError, match=r"c\.yaml"):
            corrected(counts(), path)
    with pytest.raises(
        ConfigError, match=r"line, 900000 s, away, bus: is outside the counted part"
    ):
        corrected(counts(), saved(tmp_path / "c.yaml", missed(900_000)))
    # Frames that another file counts are not outside.
    late = replace(counts(), left_out=1.0, spans=((1.0, 10.0),))
    assert len(corrected(late, saved(tmp_path / "c.yaml", missed(0.2))).events) == len(late.events)


def test_files_for_some_of_the_lines_give_one_result_in_either_order(tmp_path: Path) -> None:
    before = counts()
    first, second = events_of(before, "line"), events_of(before, "second")
    values = {"end": 100.0, "span": 10.0}
    a = saved(
        tmp_path / "a.yaml",
        *(error(event, None) for event in (*first, *second)),
        checked=spans("line", "second", end=10.0),
        sample={"seed": 1, "spans": [3, 0]},
        **values,
    )
    b = saved(
        tmp_path / "b.yaml",
        missed(15),
        checked=spans("line", start=10.0, end=20.0),
        sample={"seed": 1, "spans": [3, 1]},
        lines=BORDERS[:1],
        **values,
    )
    run = replace(before, spans=((0.0, 100.0),))
    one, other = corrected(run, a, b), corrected(run, b, a)
    assert one.events == other.events
    assert one.corrected
    assert other.corrected
    assert one.corrected.checked == other.corrected.checked == ((0.0, 10.0),)
    events = error(first[0], None), missed(9)
    c = saved(tmp_path / "c.yaml", *events, checked=spans("line"), lines=BORDERS[:1])
    with pytest.raises(ConfigError, match="contradict each other: line, "):
        corrected(run, a, c)


@pytest.mark.parametrize("part", [(40.0, 100.0), (0.0, 60.0)])
def test_a_part_says_nothing_of_what_lies_outside_it(
    tmp_path: Path, part: tuple[float, float]
) -> None:
    run = replace(counts(), spans=((0.0, 100.0),))
    start, end = part
    checked = spans("line", "second", start=start, end=end)
    path = saved(tmp_path / "c.yaml", checked=checked, start=start, end=end, span=20.0)
    after = corrected(run, path)
    assert after.corrected
    assert (after.corrected.checked, after.corrected.estimates) == ((part,), ())
    [note] = after.findings
    assert (note.severity, note.text[:11]) == ("note", "no estimate")


def test_only_the_chosen_classes_are_estimated(tmp_path: Path) -> None:
    before = counts()
    events = [
        error(event, None) for name in ("line", "second") for event in events_of(before, name)
    ]
    path = saved(tmp_path / "c.yaml", *events, missed(8.5), checked=spans("line", "second"))
    after = corrected(before, path, classes=("bus",))
    assert after.corrected
    assert ways(after) == [("line", "away", "bus")]
    assert estimate_of(after, ALL) == (0, 1, 1, 1)
    groups = {item.group.class_name for item in after.corrected.estimates}
    assert groups == {None, "bus"}


def test_thousands_of_corrections_are_applied_and_crowds_refused(tmp_path: Path) -> None:
    [car, *_] = events_of(counts(), "line")
    events = [replace(car, time=0.7 * n, id=n, vehicle=n) for n in range(5000)]
    run = replace(at_lines(*events), spans=((0.0, 3600.0),))
    path = saved(
        tmp_path / "c.yaml",
        *(error(event, None, id=event.id + 9000, time=event.time + 0.1) for event in events),
        checked=spans("line", end=3600.0),
    )
    assert len(corrected(run, path).events) == 5000
    crowd = [missed(5 + n / 1000) for n in range(201)]
    with pytest.raises(ConfigError, match="line, 5 s: more than 200 within a second"):
        corrected(run, saved(path, *crowd))

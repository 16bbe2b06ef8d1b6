"""Corrections of counts: their files, what follows from them, and what does not fit."""

from collections import Counter
from dataclasses import replace
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
    numbered,
    settings_for,
    through,
)
from vdet.errors import ConfigError
from vdet.traffic.corrections import Corrections, read_corrections
from vdet.traffic.counting import count_frames
from vdet.traffic.counts import Counts, Event

CLASSES = ("car", "truck", "bus", "motorcycle")
SECOND = LINE.model_copy(update={"name": "second", "start": (200, 300), "end": (1000, 300)})
SIZE = WIDTH, HEIGHT
SETTINGS = settings_for(LINE, SECOND, ZONE)
BORDERS = [
    {"name": one.name, "start": [*one.start], "end": [*one.end], "left": "away", "right": "here"}
    for one in (LINE, SECOND)
]


def counts() -> Counts:
    """Two cars come at 2 s and 6 s, cross both lines, and the first enters the zone."""
    video = joined(
        frames(through((1, 500, 200), (4, 500, 700)), seconds=10),
        numbered(frames(through((5, 900, 200), (8, 900, 700)), seconds=10), 2),
    )
    named = [
        replace(frame, tracks=tuple(replace(one, class_name="car") for one in frame.tracks))
        for frame in video
    ]
    return count_frames(named, SETTINGS, SIZE)


def saved(path: Path, *events: dict[str, Any], **values: Any) -> Path:
    """Write a file of corrections."""
    given = {"video": "in.mp4", "size": [*SIZE], "lines": BORDERS, "events": [*events]} | values
    path.write_text(yaml.safe_dump(given))
    return path


def error(event: Event, kind: str, correct: str | None = None, **values: Any) -> dict[str, Any]:
    named = {"line": event.name, "time": round(event.time, 2), "direction": event.direction}
    named |= {"class": event.class_name, "id": event.id, "error": kind}
    return named | ({"correct": correct} if correct else {}) | values


def events_of(counted: Counts, name: str) -> list[Event]:
    return [event for event in counted.events if event.name == name]


def ways(counted: Counts) -> list[tuple[str, str, str | None]]:
    return [(one.name, one.direction, one.class_name) for one in counted.events]


def test_events_are_removed_added_renamed_and_turned(tmp_path: Path) -> None:
    before = counts()
    (first, second), (other, _) = events_of(before, "line"), events_of(before, "second")
    missed = {"line": "line", "time": 8.5, "direction": "away", "class": "bus", "error": "missed"}
    path = saved(
        tmp_path / "c.yaml",
        error(first, "class", "truck"),
        error(second, "direction", "away"),
        missed,
        error(events_of(before, "second")[1], "false"),
    )
    after = Corrections.read(path).apply(before)
    assert [one[1:] for one in ways(after) if one[0] == "line"] == [
        ("here", "truck"), ("away", "car"), ("away", "bus"),
    ]  # fmt: skip
    assert [one for one in ways(after) if one[0] == "second"] == [("second", "here", "truck")]
    assert {one.class_name for one in events_of(after, "zone")} == {"truck"}
    assert str(after.corrected) == "corrected: 4 events, by c.yaml"
    assert after.corrected is not None
    assert after.corrected.classes == {other.id: "truck"}
    assert sum(row.count for row in after.flows()) == 3


def test_half_a_second_is_near_enough_after_another_run(tmp_path: Path) -> None:
    before = counts()
    event = events_of(before, "line")[0]
    near = saved(tmp_path / "near.yaml", error(event, "false", time=event.time + 0.4, id=99))
    assert len(Corrections.read(near).apply(before).events) == len(before.events) - 1
    far = saved(tmp_path / "far.yaml", error(event, "false", time=event.time + 0.6))
    with pytest.raises(ConfigError, match=r"far\.yaml: line, .* s, here, car: no such event"):
        Corrections.read(far).apply(before)


def test_a_file_for_another_video_or_line_is_rejected(tmp_path: Path) -> None:
    def check(
        name: str = "in.mp4", width: int = WIDTH, height: int = HEIGHT, **values: Any
    ) -> None:
        review = read_corrections([saved(tmp_path / "c.yaml", **values)])
        settings = SETTINGS.model_copy(update={})
        count_frames([], settings, (width, height), corrections=review, name=name)

    check()
    check(width=WIDTH // 2, height=HEIGHT // 2)
    moved = [{**BORDERS[0], "start": [200.8, 400]}]
    check(lines=moved)
    with pytest.raises(ConfigError, match=r"corrects in\.mp4, not other\.mp4"):
        check("other.mp4")
    for wrong in ({"start": [203, 400]}, {"left": "off"}, {"name": "new"}):
        with pytest.raises(ConfigError, match="is not where these settings have it"):
            check(lines=[{**BORDERS[0], **wrong}])
    with pytest.raises(ConfigError, match=r"c\.yaml: size: points are for frames of 720×720"):
        check(size=[720, 720], lines=[{**BORDERS[0], "end": [700, 400]}])


def test_two_reviewers_are_merged_unless_they_contradict_each_other(tmp_path: Path) -> None:
    before = counts()
    first, second = events_of(before, "line")

    def merged(*events: dict[str, Any], checked: bool = False) -> Counts:
        span = [{"line": "line", "start": 0, "end": 10}] if checked else []
        a = saved(tmp_path / "a.yaml", error(first, "class", "bus"), error(second, "false"))
        b = saved(tmp_path / "b.yaml", *events, checked=span)
        review = read_corrections([a, b])
        assert review
        return review.apply(before)

    both = merged(error(first, "class", "bus"), error(second, "false"), checked=True)
    assert str(both.corrected) == "corrected: 2 events, by a.yaml, b.yaml"
    assert str(merged().corrected) == "corrected: 2 events, by a.yaml, b.yaml"
    for wrong, checked in ((error(first, "class", "truck"), False), (error(first, "false"), True)):
        with pytest.raises(ConfigError, match=r"a\.yaml and .*b\.yaml: contradict .*: line, "):
            merged(wrong, checked=checked)


def test_mistakes_have_a_position(tmp_path: Path) -> None:
    path = tmp_path / "c.yaml"
    text = "video: in.mp4\nsize: [1280, 720]\nevents:\n"
    text += "  - {line: a, time: 1, direction: x, error: bad}\n"
    path.write_text(text)
    with pytest.raises(ConfigError, match=r"c\.yaml:4:\d+: events\[0\]\.error: must be 'false'"):
        Corrections.read(path)
    path.write_text(text.replace("bad", "false"))
    with pytest.raises(ConfigError, match="events: a has no direction x"):
        Corrections.read(path)


def test_true_corrections_make_counts_by_class_exact(tmp_path: Path) -> None:
    """600 vehicles at a line; 5 % are not counted, 3 % twice, and 10 % have a wrong class."""
    random = np.random.default_rng(3)
    times = np.sort(random.uniform(0, 3600, 600)).round(3).tolist()
    truth = [
        Event(time, round(25 * time), "line", str(random.choice(["away", "here"])), n, n,
              str(random.choice(CLASSES)), 0.9)
        for n, time in enumerate(times, start=1)
    ]  # fmt: skip
    counted, errors = list[Event](), list[dict[str, Any]]()
    for event, chance in zip(truth, random.uniform(size=len(truth)).tolist(), strict=True):
        if chance < 0.05:
            errors.append(error(event, "missed", id=-1))
            continue
        if chance < 0.15:
            other = CLASSES[(CLASSES.index(event.class_name or "") + 1) % len(CLASSES)]
            wrong = replace(event, class_name=other)
            errors.append(error(wrong, "class", event.class_name))
        else:
            wrong = event
        counted.append(wrong)
        if chance > 0.97:
            twin = replace(wrong, id=1000 + event.id, vehicle=1000 + event.id)
            counted.append(twin)
            errors.append(error(twin, "false"))
    assert len(errors) > 90
    run = Counts(tuple(counted), (("line", "away"), ("line", "here")), ())
    after = Corrections.read(saved(tmp_path / "c.yaml", *errors)).apply(run)
    by_class = Counter((one.direction, one.class_name) for one in after.events)
    assert by_class == Counter((one.direction, one.class_name) for one in truth)

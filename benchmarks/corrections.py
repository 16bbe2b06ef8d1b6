"""Counts by class of drawn pole cameras, corrected by a reviewer who sees the truth at the lines.

    python -m benchmarks.corrections

Of the true tracks of the thirty scenes, 5 % are missing, 3 % are doubled, and 10 % have another
class. The corrections are then applied to five kinds of other runs, of which each column says how
many vehicles are wrong.
"""

import json
import time
import tracemalloc
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.pole_cameras import HEIGHT, WIDTH, PoleScene, pole_scenes
from vdet.boxes import Box
from vdet.config.schema import Settings
from vdet.review.corrections import Corrections, ReviewedEvent, apply_corrections, paired
from vdet.track.track import FrameTracks, Track
from vdet.traffic.counting import count_frames
from vdet.traffic.counts import Counts, Event

CLASSES = ("car", "truck", "bus", "motorcycle")
LINE = {"name": "gate", "start": [0, 100], "end": [WIDTH, 100], "left": "in", "right": "out"}
MISSING, DOUBLED, RENAMED = 0.05, 0.03, 0.10
_SHIFT = 4
"""Distance of the second track of a vehicle, pixels."""


def classified(scene: PoleScene, seed: int) -> list[FrameTracks]:
    """Return every second frame of a scene, with a random class of each vehicle."""
    random = np.random.default_rng(seed)
    classes = {number: str(random.choice(CLASSES)) for number in scene.trips}
    return [
        replace(frame, tracks=tuple(replace(t, class_name=classes[t.id]) for t in frame.tracks))
        for frame in scene.true_tracks(every=2)
    ]


def damaged(video: Sequence[FrameTracks], seed: int, lost: float = MISSING) -> list[FrameTracks]:
    """Return tracks of which some are missing, doubled or of another class."""
    random = np.random.default_rng(seed)
    ids = sorted({track.id for frame in video for track in frame.tracks})
    missing, doubled, renamed = (
        {number for number in ids if random.random() < part} for part in (lost, DOUBLED, RENAMED)
    )

    def shown(track: Track) -> Iterator[Track]:
        if track.id in missing:
            return
        if track.id in renamed:
            class_name = CLASSES[(CLASSES.index(track.class_name or "") + 1) % len(CLASSES)]
            track = replace(track, class_name=class_name)
        yield track
        if track.id in doubled:
            box = track.box
            box = Box(box.x1 + _SHIFT, box.y1 + _SHIFT, box.x2 + _SHIFT, box.y2 + _SHIFT)
            yield replace(track, id=1000 + track.id, box=box)

    return [
        replace(frame, tracks=tuple(t for track in frame.tracks for t in shown(track)))
        for frame in video
    ]


def reviewed(true: Event | None, counted: Event | None) -> dict[str, Any]:
    """Return what a reviewer says of a vehicle that passed, was counted, or both."""
    event = counted or true
    assert event
    text = {"line": event.name, "time": round(event.time, 2), "direction": event.direction}
    text |= {"class": event.class_name} | ({"id": counted.id} if counted else {})
    if true is None or counted is None:
        return text | {"error": "missed" if counted is None else "false"}
    if true.class_name != counted.class_name:
        return text | {"error": "class", "correct": true.class_name}
    return text


def review(truth: Counts, counted: Counts, settings: Settings) -> Corrections:
    """Return the corrections of a reviewer who sees the truth at the lines."""
    traffic = settings.traffic.for_frames(WIDTH, HEIGHT)
    lines = [line.model_dump(exclude={"size"}) for line in traffic.lines]
    passed = [ReviewedEvent.model_validate(reviewed(event, None)) for event in truth.events]
    true = dict(zip(map(id, passed), truth.events, strict=True))
    events = [
        reviewed(true[id(event)] if event else None, found)
        for event, found in paired(passed, counted.events)
    ]
    first, last = truth.spans[0][0], truth.spans[-1][1]
    checked = [
        {"line": line["name"], "start": first, "end": last + 1, "complete": True} for line in lines
    ]
    values = {"video": "in.mp4", "size": [WIDTH, HEIGHT], "lines": lines, "events": events}
    return Corrections.model_validate({**values, "start": first, "end": last, "checked": checked})


def other_runs(
    video: Sequence[FrameTracks], counted: Counts, settings: Settings, seed: int
) -> dict[str, Counts]:
    """Return what other runs on a video count, by their kind."""
    random = np.random.default_rng(seed)
    size = (WIDTH, HEIGHT)
    other = count_frames(damaged(video, seed + 1000), settings, size)
    times = [max(0.0, event.time + random.uniform(-0.2, 0.2)) for event in other.events]
    shifted = (replace(e, time=round(t, 3)) for e, t in zip(other.events, times, strict=True))
    numbered = (replace(e, id=e.id + 500, vehicle=e.vehicle + 500) for e in counted.events)
    return {
        "other detector": replace(other, events=tuple(shifted)),
        "other threshold": count_frames(damaged(video, seed, lost=0.4), settings, size),
        "ids renumbered": replace(counted, events=tuple(numbered)),
        "events deleted": replace(counted, events=counted.events[::2]),
        "none found": replace(counted, events=()),
    }


def by_class(counts: Counts) -> Counter[tuple[str, str, str | None]]:
    """Return the number of vehicles by line, direction and class."""
    return Counter((event.name, event.direction, event.class_name) for event in counts.events)


def differences(truth: Counts, counts: Counts) -> int:
    """Return how many vehicles are too few and too many, by line, direction and class."""
    true, counted = by_class(truth), by_class(counts)
    return ((true - counted) + (counted - true)).total()


def cost_of_thousands(folder: Path, number: int = 5000) -> tuple[float, float]:
    """Return the processor seconds, and the MB at most, that corrections spread over an hour take.

    Every second event has the wrong class, and every third was missed; all are listed.
    """
    line = LINE | {"start": [0, 100 / HEIGHT], "end": [1, 100 / HEIGHT]}
    settings = Settings.model_validate({"traffic": {"lines": [line]}})
    times = [round(3600 * n / number, 3) for n in range(number)]
    events = [
        {"line": "gate", "time": moment, "direction": "in", "class": "car"}
        | ({"error": "missed"} if n % 3 == 0 else {"id": n})
        | ({"error": "class", "correct": "bus"} if n % 2 and n % 3 else {})
        for n, moment in enumerate(times)
    ]
    checked = [{"line": "gate", "start": 0, "end": 3600, "complete": True}]
    values = {"video": "in.mp4", "size": [WIDTH, HEIGHT], "lines": [LINE], "checked": checked}
    path = folder / "corrections.yaml"
    path.write_text(json.dumps({**values, "end": 3600, "events": events}), encoding="utf-8")
    found = tuple(
        Event(at, n, "gate", "in", n, n, "car", 0.9) for n, at in enumerate(times) if n % 3
    )
    counts = Counts(found, (("gate", "in"), ("gate", "out")), (), spans=((0.0, 3600.0),))

    def apply() -> None:
        corrected = apply_corrections({"": counts}, [Corrections.read(path)], settings)[""]
        assert len(corrected.events) == number

    apply()  # imports
    begin = time.process_time()
    apply()
    seconds = time.process_time() - begin
    tracemalloc.start()
    apply()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return seconds, peak / 1e6


def main() -> None:
    """Measure all scenes; print a row for each."""
    kinds = "other detector | other threshold | ids renumbered | events deleted | none found"
    print(f"scene | vehicles at lines | corrections | wrong before | wrong after | {kinds}")
    for seed, scene in zip(count(1), pole_scenes(), strict=False):
        video = classified(scene, seed)
        truth = count_frames(video, scene.settings, (WIDTH, HEIGHT))
        counted = count_frames(damaged(video, seed), scene.settings, (WIDTH, HEIGHT))
        made = review(truth, counted, scene.settings)
        after = apply_corrections({"": counted}, [made], scene.settings)[""]
        corrections = len(after.corrected.corrections) if after.corrected else 0
        wrong = [differences(truth, counts) for counts in (counted, after)]
        for run in other_runs(video, counted, scene.settings, seed).values():
            result = apply_corrections({"": run}, [made], scene.settings)[""]
            wrong.append(differences(truth, result))
        print(scene.name, len(truth.events), corrections, *wrong, sep=" | ")


if __name__ == "__main__":
    main()

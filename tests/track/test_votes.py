"""The class of a track: decided by the tracker alone, from what shows most of the vehicle."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest

import vdet
from vdet.boxes import NO_BOXES, Box, Boxes
from vdet.config.kinds import RulesTrackerSettings
from vdet.config.scene import LineSettings, TrafficSettings
from vdet.config.schema import MotionTrackerSettings, Settings
from vdet.labels.label import SourceVideo, TrackWriter, last_classes, track_formats
from vdet.media import Picture
from vdet.track.motion.tracker import MotionTracker
from vdet.track.rules import RulesTracker
from vdet.track.track import FrameTracks, Track
from vdet.traffic.records import VehicleRecords

SIZE = WIDTH, HEIGHT = 1280, 720
RATE = 25
NAMES = ("car", "truck", "bus")

Seen = tuple[Box, dict[str, float]]
"""The box of a vehicle, and how likely each class is."""


def detections(box: Box, likely: dict[str, float]) -> Boxes:
    scores = [likely.get(name, 0.0) for name in NAMES]
    return Boxes(
        [(box.x1, box.y1, box.x2, box.y2)],
        [0.9],
        classes=[int(np.argmax(scores))],
        names=NAMES,
        data={"class_scores": [scores]},
    )


def follow(seen: Iterable[Seen | None]) -> list[FrameTracks]:
    """Track a vehicle that is seen like this in each frame, or not at all."""
    tracker = MotionTracker(MotionTrackerSettings(), *SIZE)
    frames = []
    for n, path in enumerate(seen):
        found = detections(*path) if path else NO_BOXES
        frames.append(FrameTracks(n, n / RATE, tuple(tracker.update(found, n / RATE))))
    return frames


def coming(name: str, near: str, *, far_frames: int = 200, near_frames: int = 20) -> Iterator[Seen]:
    """Give a vehicle that is 30 pixels wide for long, and soon 300 when it comes near."""
    frames = far_frames + near_frames
    for n in range(frames):
        width = 30 * 10 ** (max(0, n - far_frames + 20) / (near_frames + 20))
        middle, bottom = 400 + n / 2, 300 + width
        box = Box(middle - width / 2, bottom - 0.8 * width, middle + width / 2, bottom)
        yield box, {name if n < far_frames else near: 0.8, "bus": 0.2}


def test_a_truck_that_is_far_for_long_and_called_a_car_is_a_truck() -> None:
    frames = follow(coming("car", "truck"))
    (ids,) = {tuple(track.id for track in frame.tracks) for frame in frames[20:]}
    classes = [track.class_name for frame in frames for track in frame.tracks]
    assert ids == (1,)
    assert (classes[0], classes[150], classes[-1]) == ("car", "car", "truck")


def test_what_is_made_at_the_end_has_the_last_class_of_the_track(tmp_path: Path) -> None:
    frames = follow(coming("car", "truck"))
    records = VehicleRecords(WIDTH)
    for frame in frames:
        records.add(frame)
    line = LineSettings(name="gate", start=(0.35, 0.0), end=(0.35, 1.0))  # crossed as a car
    settings = Settings(traffic=TrafficSettings(lines=(line,)))
    live = vdet.count(frames, settings, size=SIZE)
    assert [record.class_name for record in records.end()] == ["truck"]
    assert [event.class_name for event in live.events] == ["truck"]
    assert last_classes(frames) == {1: "truck"}
    for form in track_formats():
        if form.suffix not in (".csv", ".jsonl", ".coco.json"):
            continue
        path = tmp_path / f"tracks{form.suffix}"
        with path.open("wb") as file:
            writer = TrackWriter(form, file, SourceVideo("a.mp4", *SIZE))
            for frame in frames:
                writer.write(frame)
            writer.end()
        saved = vdet.count(path, settings, size=SIZE)
        assert [(e.name, e.class_name) for e in saved.events] == [("gate", "truck")], form.name


def test_a_box_cut_off_by_the_frame_hardly_counts() -> None:
    seen = []
    for n in range(34):
        box = Box(1055 + 5 * n, 300, min(1255 + 5 * n, WIDTH), 450)  # whole in 4 frames
        seen.append((box, {"truck" if n < 4 else "car": 1.0}))
    frames = follow(seen)
    assert {track.class_name for frame in frames for track in frame.tracks} == {"truck"}


@pytest.mark.parametrize(
    ("likely", "name"),
    [
        ([{"car": 0.6, "truck": 0.4}, {"truck": 0.9, "car": 0.1}, {"car": 0.6, "truck": 0.4}],
         "truck"),
        ([{"car": 0.5, "truck": 0.35, "bus": 0.15}], "truck"),
        ([{"car": 0.5, "truck": 0.25, "bus": 0.25}], "vehicle"),
        ([{"car": 0.55, "truck": 0.35, "bus": 0.1}], "vehicle"),
        ([{"car": 0.65, "truck": 0.35}], "car"),
        ([{"truck": 0.45, "bus": 0.55}], "bus"),
    ],
    ids=["the sure search decides", "trucks look like cars", "not clear", "rather a car", "car",
         "no car"],
)  # fmt: skip
def test_searches_vote_with_the_likelihood_of_each_class(
    likely: list[dict[str, float]], name: str
) -> None:
    box = Box(500, 300, 600, 380)
    frames = follow((box, likely[n % len(likely)]) for n in range(30))
    assert {track.class_name for track in frames[-1].tracks} == {name}


def test_a_vehicle_that_is_found_again_keeps_what_it_showed_before() -> None:
    box = Box(500, 300, 600, 380)
    seen: list[Seen | None] = [(box, {"truck": 1.0})] * 30
    seen += [None] * 15
    seen += [(box, {"car": 1.0})] * 10
    frames = follow(seen)
    shown = {(track.id, track.class_name) for frame in frames for track in frame.tracks}
    assert shown == {(1, "truck")}


def test_the_rules_tracker_votes_in_the_same_way() -> None:
    tracker = RulesTracker(RulesTrackerSettings())
    picture = Picture(np.random.default_rng(1).integers(0, 255, (HEIGHT, WIDTH, 3), np.uint8))
    shown: list[Track] = []
    for n, (name, width) in enumerate([("car", 60)] * 30 + [("truck", 150)] * 10):
        box = Box(500, 300, 500 + width, 300 + width)
        shown = tracker.update(detections(box, {name: 1.0}), n / RATE, picture)
    assert [track.class_name for track in shown] == ["truck"]

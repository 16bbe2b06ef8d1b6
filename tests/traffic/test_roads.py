"""Counts on drawn roads, whose truth is known: exact in every scene in which tracking is."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from track.motion.scenes import HEIGHT, WIDTH
from track.motion.traffic import (
    Noise,
    TrueVehicle,
    detect,
    random_traffic,
    truth_at,
)
from vdet.boxes import Box, Boxes
from vdet.config.places import CountSettings, LineSettings
from vdet.config.schema import MotionTrackerSettings
from vdet.synthetic.random_scenes import demo_scene
from vdet.synthetic.scene import Scene, SceneVehicle, Waypoint
from vdet.synthetic.truth import must_be_found, true_boxes
from vdet.track.motion.tracker import MotionTracker
from vdet.track.track import FrameTracks, Track
from vdet.traffic.counter import count_frames
from vdet.traffic.counts import Event

RATE, SECONDS = 25, 8
SLIGHT = Noise(sides=0.02, missed=0.05, false=0.02, surest=0.3)
SEEDS = (2, 20, 23)
"""Of scenes in which tracking is exact."""


def across(frames: Sequence[FrameTracks], row: float, width: int, height: int) -> tuple[Event, ...]:
    """Count at a line over the whole width; vehicles that come nearer cross it to the right."""
    line = LineSettings(name="row", start=(0, row), end=(1, row), left="away", right="nearer")
    return count_frames(frames, CountSettings(lines=(line,)), (width, height)).events


def ways(frames: Sequence[FrameTracks], row: float) -> list[str]:
    return sorted(event.direction for event in across(frames, row, 320, 180))


def followed(
    find: Callable[[int], Boxes], count: int, width: int, height: int
) -> list[FrameTracks]:
    tracker = MotionTracker(MotionTrackerSettings(), width, height)
    return [
        FrameTracks(n, n / RATE, tuple(tracker.update(find(n), n / RATE))) for n in range(count)
    ]


@pytest.mark.parametrize("seed", SEEDS)
def test_random_traffic(seed: int) -> None:
    """Boxes of the tracker are counted as those of the truth are, on every row of the road."""
    vehicles = random_traffic(seed, SECONDS, fastest=6)
    clip = [truth_at(vehicles, n / RATE) for n in range(SECONDS * RATE)]
    rng = np.random.default_rng(seed)
    tracks = followed(lambda n: detect(clip[n], SLIGHT, rng), len(clip), WIDTH, HEIGHT)
    true = [
        FrameTracks(n, n / RATE, tuple(_true_track(each) for each in there if each.counts))
        for n, there in enumerate(clip)
    ]
    same, counted = _pairs(tracks, true), 0
    for row in (0.66, 0.7, 0.74, 0.78):
        unclear = _unclear(true, row * HEIGHT)
        found = {(same[e.id], e.direction) for e in across(tracks, row, WIDTH, HEIGHT)}
        expected = {(e.id, e.direction) for e in across(true, row, WIDTH, HEIGHT)}
        assert {e for e in found if e[0] not in unclear} == {
            e for e in expected if e[0] not in unclear
        }, row
        counted += len(expected)
    assert counted > 2, "choose another seed"


def _true_track(vehicle: TrueVehicle) -> Track:
    return Track(vehicle.id, Box(*vehicle.box.tolist()), 1.0, predicted=False)


def _unclear(true: Sequence[FrameTracks], row: float) -> set[int]:
    """Return the vehicles that are first or last seen so near to a row that no side is clear."""
    first: dict[int, Track] = {}
    last: dict[int, Track] = {}
    for frame in true:
        for track in frame.tracks:
            first.setdefault(track.id, track)
            last[track.id] = track
    ends = (*first.values(), *last.values())
    return {each.id for each in ends if abs(each.foot[1] - row) < 0.2 * each.box.height}


def _pairs(tracks: Sequence[FrameTracks], true: Sequence[FrameTracks]) -> dict[int, int]:
    """Return the vehicle of each track; tracking is exact: each has one track of its own."""
    pairs = {
        (a.id, b.id)
        for found, there in zip(tracks, true, strict=True)
        for a in found.tracks
        for b in there.tracks
        if a.box.iou(b.box) > 0.5
    }
    shown = {track.id for frame in tracks for track in frame.tracks}
    known = {track.id for frame in true for track in frame.tracks}
    same = dict(pairs)
    assert len(pairs) == len(same) == len(shown) == len(known), "choose another seed"
    return same


@pytest.mark.parametrize("seed", [3])
def test_the_road_of_the_demo(seed: int) -> None:
    """Vehicle 3 is overtaken, and vehicle 4 overtakes: each crosses the line once."""
    scene = demo_scene(seed, width=320, height=180)
    tracks = followed(lambda n: seen(scene, n), scene.frames, 320, 180)
    assert len({track.id for frame in tracks for track in frame.tracks}) == 4
    assert ways(tracks, 0.75) == ["away", "nearer"]
    by_truth = [
        FrameTracks(
            n, n / RATE, tuple(Track(v.id, v.box, 1.0, False) for v in true_boxes(scene, n))
        )
        for n in range(scene.frames)
    ]
    assert ways(by_truth, 0.75) == ["away", "nearer"]
    times = [
        [event.time for event in across(frames, 0.75, 320, 180)] for frames in (tracks, by_truth)
    ]
    assert times[0] == pytest.approx(times[1], abs=0.2)
    vehicle = {event.direction: event.id for event in across(by_truth, 0.75, 320, 180)}
    assert vehicle == {"nearer": 3, "away": 4}


def test_a_vehicle_that_stops_and_reverses_on_the_line() -> None:
    scene = demo_scene(1, width=320, height=180)
    back = ((0.0, 20.0, 3.7), (3.0, 6.5, 3.7), (5.0, 6.5, 3.7), (9.0, 25.0, 3.7))
    path = tuple(Waypoint(*point) for point in back)
    (one,) = [each for each in scene.vehicles if each.id == 3]
    vehicle: SceneVehicle = replace(one, path=path)
    scene = replace(scene, vehicles=(vehicle,), frames=220)
    tracks = followed(lambda n: seen(scene, n), scene.frames, 320, 180)
    feet = [frame.tracks[0].foot[1] for frame in tracks if frame.tracks]
    lowest = max(feet) / 180
    assert ways(tracks, lowest - 0.08) == ["away", "nearer"]
    assert ways(tracks, lowest + 0.02) == []


def seen(scene: Scene, index: int) -> Boxes:
    boxes: list[Box] = [
        each.box for each in true_boxes(scene, index) if must_be_found(each, scene.camera.height)
    ]
    corners = [(box.x1, box.y1, box.x2, box.y2) for box in boxes]
    return Boxes(np.reshape(corners, (-1, 4)), np.full(len(boxes), 0.95))

"""Counts on drawn roads, whose truth is known: exact in every scene in which tracking is."""

from collections.abc import Sequence

import numpy as np
import pytest

from track.motion.scenes import HEIGHT, WIDTH
from track.motion.traffic import Noise, TrueVehicle, detect, random_traffic, truth_at
from vdet.boxes import Box
from vdet.config.places import LineSettings, TrafficSettings
from vdet.config.schema import MotionTrackerSettings, Settings
from vdet.track.motion.tracker import MotionTracker
from vdet.track.track import FrameTracks, Track
from vdet.traffic.counting import count_frames

RATE, SECONDS = 25, 8
SLIGHT = Noise(sides=0.02, missed=0.05, false=0.02, surest=0.3)
SEEDS = (2, 20, 23)
"""Of scenes in which tracking is exact."""


def across(frames: Sequence[FrameTracks], row: float) -> set[tuple[int, str]]:
    """Count at a line over the whole width: return the id and the direction of each event."""
    line = LineSettings(name="row", start=(0, row), end=(1, row), left="away", right="nearer")
    counts = count_frames(frames, Settings(traffic=TrafficSettings(lines=(line,))), (WIDTH, HEIGHT))
    return {(event.id, event.direction) for event in counts.events}


@pytest.mark.parametrize("seed", SEEDS)
def test_random_traffic(seed: int) -> None:
    """Boxes of the tracker are counted as those of the truth are, on every row of the road."""
    vehicles = random_traffic(seed, SECONDS, fastest=6)
    clip = [truth_at(vehicles, n / RATE) for n in range(SECONDS * RATE)]
    rng = np.random.default_rng(seed)
    tracker = MotionTracker(MotionTrackerSettings(), WIDTH, HEIGHT)
    tracks = [
        FrameTracks(n, n / RATE, tuple(tracker.update(detect(there, SLIGHT, rng), n / RATE)))
        for n, there in enumerate(clip)
    ]
    true = [
        FrameTracks(n, n / RATE, tuple(_true_track(item) for item in there if item.counts))
        for n, there in enumerate(clip)
    ]
    same, counted = _pairs(tracks, true), 0
    for row in (0.66, 0.7, 0.74, 0.78):
        unclear = _unclear(true, row * HEIGHT)
        found = {(same[number], way) for number, way in across(tracks, row)}
        expected = across(true, row)
        assert {e for e in found ^ expected if e[0] not in unclear} == set(), row
        counted += len(expected)
    assert counted > 2, "choose another seed"


def _true_track(vehicle: TrueVehicle) -> Track:
    return Track(vehicle.id, Box(*vehicle.box.tolist()), 1.0, state="detected")


def _unclear(true: Sequence[FrameTracks], row: float) -> set[int]:
    """Return the vehicles that are first or last seen so near to a row that no side is clear."""
    first: dict[int, Track] = {}
    last: dict[int, Track] = {}
    for frame in true:
        for track in frame.tracks:
            first.setdefault(track.id, track)
            last[track.id] = track
    ends = (*first.values(), *last.values())
    return {end.id for end in ends if abs(end.foot[1] - row) < 0.2 * end.box.height}


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

"""Vehicles that pass: their tracks, frame by frame."""

from collections.abc import Iterable, Iterator

from vdet.boxes import Box
from vdet.track.track import FrameTracks, Track
from vdet.traffic.records import VehicleRecord, VehicleRecords

WIDTH, HEIGHT = 320, 240
RATE = 25


def track(number: int, box: Box, *, score: float = 0.9, **rest: object) -> Track:
    return Track(number, box, score, **{"state": "detected", **rest})  # type: ignore[arg-type]


def frame(index: int, *tracks: Track, rate: float = RATE) -> FrameTracks:
    return FrameTracks(index, index / rate, tracks)


def passing(count: int, number: int = 1, speed: int = 2) -> Iterator[FrameTracks]:
    """Give frames of a vehicle of 40 × 30 pixels that goes to the right, `speed` pixels a frame."""
    for index in range(count):
        yield frame(index, track(number, Box.sized(10 + speed * index, 100, 40, 30)))


def summarize(
    frames: Iterable[FrameTracks], width: int, *, is_still: bool = False
) -> tuple[VehicleRecord, ...]:
    """Return a record of each vehicle, by id; `width` is that of the frames in pixels."""
    records = VehicleRecords(width)
    for frame in frames:
        records.add(frame)
    return records.end(is_still=is_still)

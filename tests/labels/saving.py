"""Tracks written in a format, and read again."""

import io
from collections.abc import Iterable
from pathlib import Path

from vdet.boxes import Box
from vdet.labels.protocol import Format, SourceVideo
from vdet.labels.registry import read_tracks
from vdet.labels.saved import SavedTracks
from vdet.track.track import FrameTracks, Track

VIDEO = SourceVideo("road & rail.mp4", 1280, 720)
PLACE = Box(10, 20, 30, 40)


def frame(index: int, *tracks: Track) -> FrameTracks:
    """Return a frame of a video with 25 frames a second."""
    return FrameTracks(index, index / 25, tracks)


def car(number: int = 1, box: Box = PLACE, **known: object) -> Track:
    """Return a car that the detector sees."""
    values: dict[str, object] = {"score": 0.75, "predicted": False, "class_name": "car"} | known
    return Track(number, box, **values)  # type: ignore[arg-type]


def written(form: Format, frames: Iterable[FrameTracks], video: SourceVideo = VIDEO) -> bytes:
    """Return the content of a file with these frames."""
    file = io.BytesIO()
    writer = form.open(file, video)
    for each in frames:
        writer.write(each)
    writer.end()
    return file.getvalue()


def read_back(form: Format, folder: Path, data: bytes) -> SavedTracks:
    """Read the content of a file of a format."""
    path = folder / f"tracks{form.ending}"
    path.write_bytes(data)
    return read_tracks(path)

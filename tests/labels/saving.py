"""Labels by frame and size, and tracks written in a format and read again."""

import io
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from vdet.boxes import Box
from vdet.labels.formats import Format, TrackWriter
from vdet.labels.label import (
    Label,
    SavedTracks,
    SourceVideo,
    checked_labels,
)
from vdet.labels.reading import read_tracks
from vdet.track.track import FrameTracks, Track

VIDEO = SourceVideo("road & rail.mp4", 1280, 720)
PLACE = Box.sized(10, 20, 30, 40)


def row(
    place: int | str,
    number: int,
    id_: int,
    x: float,
    y: float,
    width: float,
    height: float,
    score: float = 1.0,
    **known: Any,
) -> Label:
    """Return a label by the number of its frame, from 0, its id and its size."""
    ignored, name = known.get("ignored", False), known.get("name")
    track = Track(id_, Box.sized(x, y, width, height), score, "detected", name)
    return Label(track, place, number, ignored)


def checked_video(rows: Iterable[Label], path: Path = Path("scene")) -> SavedTracks:
    """Return checked labels as a video."""
    return SavedTracks(checked_labels(path, rows))


def frame(index: int, *tracks: Track) -> FrameTracks:
    """Return a frame of a video with 25 frames a second."""
    return FrameTracks(index, index / 25, tracks)


def car(number: int = 1, box: Box = PLACE, **known: object) -> Track:
    """Return a car that the detector sees."""
    values: dict[str, object] = {"score": 0.75, "state": "detected", "class_name": "car"} | known
    return Track(number, box, **values)  # type: ignore[arg-type]


def written(form: Format, frames: Iterable[FrameTracks], video: SourceVideo = VIDEO) -> bytes:
    """Return the content of a file with these frames."""
    file = io.BytesIO()
    writer = TrackWriter(form, file, video)
    for frame in frames:
        writer.write(frame)
    writer.end()
    return file.getvalue()


def read_back(form: Format, folder: Path, data: bytes) -> SavedTracks:
    """Read the content of a file of a format."""
    path = folder / f"tracks{form.suffix}"
    path.write_bytes(data)
    return read_tracks(path)

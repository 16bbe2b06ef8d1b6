"""Labels by frame and size, and tracks written in a format and read again."""

import io
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from vdet.boxes import Box
from vdet.labels.label import Format, SavedTracks, SourceVideo, TrackWriter, check_frames
from vdet.labels.reading import read_tracks
from vdet.track.track import FrameTracks, Track

VIDEO = SourceVideo("road & rail.mp4", 1280, 720)
PLACE = Box.sized(10, 20, 30, 40)
Row = tuple[int, Track]
"""The number of a frame, and a track in it."""


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
) -> Row:
    """Return the number of a frame, from 0, and a track by its id and its size."""
    box, name = Box.sized(x, y, width, height), known.pop("name", None)
    return number, Track(id_, box, score, "detected", name, position=place, **known)


def video_of(rows: Iterable[Row], **known: Any) -> SavedTracks:
    """Return rows as a video."""
    frames: dict[int, list[Track]] = {}
    for number, track in rows:
        frames.setdefault(number, []).append(track)
    return SavedTracks(frames, **known)


def checked_video(rows: Iterable[Row], path: Path = Path("scene")) -> SavedTracks:
    """Return rows as a video that was checked."""
    video = video_of(rows)
    check_frames(path, video.frames)
    return video


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

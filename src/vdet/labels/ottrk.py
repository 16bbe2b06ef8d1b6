"""OTVision's tracks (`.ottrk`), which OTAnalytics reads: JSON, compressed with bzip2.

Frames count from 1, pixels from 0. Boxes have their corner from version 1.1 of the detections on,
and their middle before; times are seconds since 1970 from version 1.2 on, and text before.
"""

import bz2
import io
import json
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path, PurePath
from typing import Annotated, Any, BinaryIO

from pydantic import BaseModel, BeforeValidator, Field, TypeAdapter

from vdet.errors import TruthError
from vdet.labels.formats import Format, SourceVideo, last_classes
from vdet.labels.json_stream import JsonLists
from vdet.labels.label import Corners, Label, from_size, limited
from vdet.labels.parsing import MAX_BYTES, Index, Number, Times, checked_times
from vdet.labels.video import SavedTracks
from vdet.track.track import FrameTracks
from vdet.version import __version__

_DETECTIONS, _TRACKS = "1.2", "1.1"
"""The versions that are written, of detections and of tracks."""
_COLUMNS = (
    *("class", "confidence", "x", "y", "w", "h", "frame", "occurrence", "input_file_path"),
    *("interpolated-detection", "first", "finished", "track-id"),
)
_CENTRED = ("0.", "1.0")
"""Versions of detections whose boxes have their middle."""


def _write(file: BinaryIO, video: SourceVideo, frames: Sequence[FrameTracks]) -> None:
    """Write all boxes; a video without a clock begins in 1970."""
    zero = video.begin.timestamp() if video.begin else 0.0
    classes = last_classes(frames)
    last = {track.id: frame.index for frame in frames for track in frame.tracks}
    begun: set[int] = set()
    rows = []
    for frame in frames:
        moment = f"{zero + frame.time:.6f}"
        for track in frame.tracks:
            ends = track.id not in begun, last[track.id] == frame.index
            begun.add(track.id)
            known = classes[track.id], round(track.score, 4), *track.box.xywh
            place = frame.index + 1, moment, video.name, track.state != "seen"
            rows.append(dict(zip(_COLUMNS, (*known, *place, *ends, track.id), strict=True)))
    metadata = _metadata(video, frames, zero, sorted(set(classes.values())))
    text = json.dumps({"metadata": metadata, "data": {"detections": rows}}, allow_nan=False)
    file.write(bz2.compress(text.encode()))


def _metadata(
    video: SourceVideo, frames: Sequence[FrameTracks], zero: float, classes: Sequence[str]
) -> dict[str, Any]:
    first, last = (frames[0], frames[-1]) if frames else (FrameTracks(0, 0.0, ()),) * 2
    seconds, steps = last.time - first.time, last.index - first.index
    program, name = {"otvision_version": f"vdet {__version__}"}, PurePath(video.name)
    return {
        "otdet_version": _DETECTIONS,
        "video": {
            "filename": name.stem, "filetype": name.suffix,
            "width": video.width, "height": video.height,
            "recorded_fps": round(steps / seconds, 3) if seconds > 0 else 25.0,
            "number_of_frames": last.index + 1,
            "recorded_start_date": f"{zero:.6f}",
            "length": str(timedelta(seconds=round(seconds))),
        },
        "detection": {**program, "model": {"name": "vdet", "classes": dict(enumerate(classes))}},
        "ottrk_version": _TRACKS,
        "tracking": {
            **program,
            "first_tracked_video_start": f"{zero + first.time:.6f}",
            "last_tracked_video_end": f"{zero + last.time:.6f}",
            "tracking_run_id": video.name, "frame_group": 0, "tracker": {"name": "vdet"},
        },
    }  # fmt: skip


def _seconds(value: Any) -> Any:
    """Return the seconds since 1970 of a time that is written as text."""
    if not isinstance(value, str):
        return value
    try:
        return float(value)
    except ValueError:
        return datetime.fromisoformat(value).timestamp()


_Time = Annotated[float, BeforeValidator(_seconds), Field(ge=0, le=1e11)]


class _Box(BaseModel):
    name: str | None = Field(None, alias="class")
    confidence: Number = 1.0
    x: Number
    y: Number
    w: Number
    h: Number
    frame: Index
    occurrence: _Time
    is_interpolated: bool = Field(False, alias="interpolated-detection")
    id: Index = Field(alias="track-id")


class _Video(BaseModel):
    width: Index = 0
    height: Index = 0
    begin: _Time = Field(alias="recorded_start_date")


class _Metadata(BaseModel):
    version: str = Field(alias="otdet_version", pattern=r"^\d{1,4}\.\d")
    video: _Video


_KINDS = {"metadata": TypeAdapter[Any](_Metadata), "data.detections": TypeAdapter[Any](_Box)}


def read_ottrk(path: Path, data: bytes) -> SavedTracks:
    """Read tracks of any version. Raises `TruthError` if it is damaged, or of another form."""
    metadata: list[_Metadata] = []
    moments: Times = {}
    try:
        labels = tuple(limited(path, _labels(data, metadata, moments)))
        if not metadata:
            raise ValueError("metadata: Field required")
    except TruthError:
        raise
    except (EOFError, OSError, ValueError) as error:
        what = "is cut off" if isinstance(error, EOFError) else error
        raise TruthError(f"{path}: is not OTVision's tracks: {what}") from error
    video = metadata[0].video
    if metadata[0].version.startswith(_CENTRED):
        labels = tuple(each._replace(box=_around(each.box)) for each in labels)
    times = {frame: (place, moment - video.begin) for frame, (place, moment) in moments.items()}
    size = (video.width, video.height) if video.width and video.height else None
    begin = datetime.fromtimestamp(video.begin, UTC)
    return SavedTracks(labels, (), checked_times(path, times), size, begin)


def _labels(data: bytes, metadata: list[_Metadata], moments: Times) -> Iterator[Label]:
    """Yield the boxes, put the metadata into a list and the seconds since 1970 into `moments`.

    Boxes begin at x and y, as in the later versions. Errors are those of `bz2` and of `JsonLists`.
    """
    unpacked, left = bz2.BZ2File(io.BytesIO(data)), MAX_BYTES

    def read(size: int) -> bytes:
        nonlocal left
        part = unpacked.read(size)
        left -= len(part)
        if left < 0:
            raise ValueError(f"is larger than {MAX_BYTES:,} bytes")
        return part

    for name, number, entry in JsonLists(read, _KINDS):
        if name == "metadata":
            metadata.append(entry)
            continue
        place, corners = f"{name}.{number}", from_size(entry.x, entry.y, entry.w, entry.h)
        known = entry.name, entry.frame, entry.id, entry.confidence, False
        yield Label(place, corners, *known, "between" if entry.is_interpolated else "seen")
        moments[entry.frame - 1] = place, entry.occurrence


def _around(box: Corners) -> Corners:
    """Return a box around the corner of another, of the same size."""
    x, y, right, bottom = box
    return from_size(x - (right - x) / 2, y - (bottom - y) / 2, right - x, bottom - y)


OTTRK = Format("OTVision tracks", ".ottrk", read_ottrk, whole=_write)

"""OTVision's tracks (`.ottrk`), which OTAnalytics reads: JSON, compressed with bzip2.

Frames count from 1, pixels from 0. Boxes have their corner from version 1.1 of the detections on,
and their middle before; times are seconds since 1970 from version 1.2 on, and text before.
"""

import bz2
import json
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path, PurePath
from typing import Annotated, Any, BinaryIO

from pydantic import AliasPath, BaseModel, BeforeValidator, Field

from vdet.errors import TruthError
from vdet.labels.formats import UNKNOWN, Format, SourceVideo, best_classes
from vdet.labels.label import Label, from_size, limited
from vdet.labels.parsing import MAX_BYTES, Index, Number, checked_times, first_mistake
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
    last = {track.id: frame.index for frame in frames for track in frame.tracks}
    begun: set[int] = set()
    rows = []
    for frame in frames:
        moment = f"{zero + frame.time:.6f}"
        for track in frame.tracks:
            ends = track.id not in begun, last[track.id] == frame.index
            begun.add(track.id)
            known = track.class_name or UNKNOWN, round(track.score, 4), *track.box.xywh
            place = frame.index + 1, moment, video.name, track.state != "seen"
            rows.append(dict(zip(_COLUMNS, (*known, *place, *ends, track.id), strict=True)))
    metadata = _metadata(video, frames, zero)
    text = json.dumps({"metadata": metadata, "data": {"detections": rows}}, allow_nan=False)
    file.write(bz2.compress(text.encode()))


def _metadata(video: SourceVideo, frames: Sequence[FrameTracks], zero: float) -> dict[str, Any]:
    first, last = (frames[0], frames[-1]) if frames else (FrameTracks(0, 0.0, ()),) * 2
    seconds, steps = last.time - first.time, last.index - first.index
    program, name = {"otvision_version": f"vdet {__version__}"}, PurePath(video.name)
    classes = dict(enumerate(sorted(set(best_classes(frames).values()))))
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
        "detection": {**program, "model": {"name": "vdet", "classes": classes}},
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


_VIDEO = "metadata", "video"


class _Document(BaseModel):
    version: str = Field(
        validation_alias=AliasPath("metadata", "otdet_version"), pattern=r"^\d{1,4}\.\d"
    )
    width: Index = Field(0, validation_alias=AliasPath(*_VIDEO, "width"))
    height: Index = Field(0, validation_alias=AliasPath(*_VIDEO, "height"))
    begin: _Time = Field(validation_alias=AliasPath(*_VIDEO, "recorded_start_date"))
    boxes: list[_Box] = Field(validation_alias=AliasPath("data", "detections"))


def read_ottrk(path: Path, data: bytes) -> SavedTracks:
    """Read tracks of any version. Raises `TruthError` if it is damaged, or of another form."""
    try:
        expander = bz2.BZ2Decompressor()
        text = expander.decompress(data, MAX_BYTES)
        if not expander.eof:
            raise ValueError(f"is cut off, or larger than {MAX_BYTES:,} bytes")
        document = _Document.model_validate_json(text)
    except (OSError, ValueError) as error:  # also a ValidationError
        what = error if isinstance(error, OSError) else first_mistake(error)
        raise TruthError(f"{path}: is not OTVision's tracks: {what}") from error
    share = 0.5 if document.version.startswith(_CENTRED) else 0.0
    labels: list[Label] = []
    times: dict[int, tuple[int | str, float]] = {}
    for number, box in enumerate(document.boxes):
        place = f"data.detections.{number}"
        corners = from_size(box.x - share * box.w, box.y - share * box.h, box.w, box.h)
        known = box.name, box.frame, box.id, box.confidence, False
        labels.append(Label(place, corners, *known, "between" if box.is_interpolated else "seen"))
        times[box.frame - 1] = place, box.occurrence - document.begin
    shape = document.width, document.height
    size, begin = shape if all(shape) else None, datetime.fromtimestamp(document.begin, UTC)
    return SavedTracks(tuple(limited(path, labels)), (), checked_times(path, times), size, begin)


OTTRK = Format("OTVision tracks", ".ottrk", read_ottrk, whole=_write)

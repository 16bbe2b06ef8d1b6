"""OTVision's tracks (`.ottrk`), which OTAnalytics reads: JSON, compressed with bzip2.

Frames count from 1, pixels from 0. Times are seconds since 1970.
"""

import bz2
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from itertools import count
from pathlib import Path, PurePath
from typing import Any, BinaryIO

from pydantic import BaseModel, Field, ValidationError

from vdet.errors import TruthError
from vdet.labels import parsing
from vdet.labels.documents import json_values
from vdet.labels.formats import Format, SourceVideo, last_classes
from vdet.labels.label import SavedTracks, known_size
from vdet.labels.parsing import Index, Row, first_mistake
from vdet.track.track import FrameTracks
from vdet.version import __version__

_DETECTIONS, _TRACKS = "1.2", "1.1"
"""The versions that are written, of detections and of tracks."""
_COLUMNS = (
    *("class", "confidence", "x", "y", "w", "h", "frame", "occurrence", "input_file_path"),
    *("interpolated-detection", "first", "finished", "track-id"),
)


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
            place = frame.index + 1, moment, video.name, track.state != "detected"
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


class _Video(BaseModel):
    width: Index = 0
    height: Index = 0
    begin: float = Field(alias="recorded_start_date", ge=0, le=1e11)


_BEFORE_STATE = ("frame", "occurrence", "track-id", "x", "y", "w", "h", "confidence")
_PLACES = _HEAD, _BOX = "metadata.video", "data.detections.item"


def read_ottrk(path: Path, data: bytes) -> SavedTracks:
    """Read tracks with detections of version 1.2, or one that is compatible.

    Raises
    ------
    TruthError
        The file is damaged, of another form or version, or expands to more than `MAX_BYTES`.
    """
    what = f"{path}: is not OTVision's tracks with detections of version {_DETECTIONS}"
    videos: list[_Video] = []

    def rows() -> Iterator[Row]:
        file, number = bz2.BZ2File(io.BytesIO(data)), count()
        for place, value in json_values(path, file, *_PLACES, most=parsing.MAX_BYTES):
            if place == _HEAD:
                videos.append(_Video.model_validate(value))
            else:
                yield f"{_BOX.removesuffix('item')}{next(number)}", _row(value)

    try:
        labels, moments = parsing.read_rows(path, rows(), first_frame=1)
    except (EOFError, OSError, AttributeError, ValidationError) as error:
        raise TruthError(f"{what}, or is damaged: {first_mistake(error)}") from error
    if not videos:
        raise TruthError(f"{what}: has no {_HEAD}")
    [video, *_] = videos
    times = {frame: moment - video.begin for frame, moment in moments.items()}
    size = known_size(video.width, video.height)
    begin = datetime.fromtimestamp(video.begin, UTC).astimezone()
    return SavedTracks(labels, None, times, size, begin)


def _row(box: Mapping[str, Any]) -> tuple[Any, ...]:
    state = "interpolated" if box.get("interpolated-detection") else "detected"
    return (*map(box.get, _BEFORE_STATE), state, box.get("class"), None, None, None)


OTTRK = Format("OTVision tracks", ".ottrk", read_ottrk, whole=_write)

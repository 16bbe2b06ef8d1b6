"""Shown boxes, frame by frame, as text: MOTChallenge, CSV or JSON lines, by the file's suffix.

| suffix   | a line is          | columns                                                          |
|----------|--------------------|------------------------------------------------------------------|
| `.txt`   | a box              | `frame, id, left, top, width, height, 1, -1, -1, -1`, no heading |
| `.csv`   | a box              | `frame,time,id,x,y,width,height,from_match`, with heading        |
| `.jsonl` | a frame, even if   | `frame`, `time`, `tracks`: a list of objects with `id`, `x`, `y`,|
|          | nothing is in it   | `width`, `height`, `from_match`; with `--lanes` also `lane`      |

In `.csv` and `.jsonl` frames count from 0 from the start of the file, `time` is in seconds, and
`x, y` is the top-left pixel of the box, counted from 0. In `.txt` frames and pixels count from 1,
as MOTChallenge has it (Milan et al., "MOT16", 2016).

Boxes are in pixels of the input frame, also where the frame is drawn undistorted, so they can be
compared with labels of the input. `lane` is null where none is shown, else an object with `radius`
(metres, null on a straight road), `offset` (of the camera from the lane's middle, metres, positive
to the right), `width` (metres), `left` and `right`: each line as `[[x, y], …]`, pixels of the
undistorted frame counted from 0, the nearest point first.
"""

import csv
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol, TextIO

from vdet.errors import OutputError
from vdet.files import replacing
from vdet.lanes.record import lane_record
from vdet.lanes.road import Road
from vdet.media import Frame
from vdet.track.track import Track


class TrackWriter(Protocol):
    """Takes the shown tracks of one frame after the other."""

    def write(self, frame: Frame, tracks: Sequence[Track], road: Road | None = None, /) -> None:
        """Add the tracks of a frame, and its lane where the format has a place for it."""


class NoTracks:
    """Takes tracks and writes nothing."""

    def write(self, frame: Frame, tracks: Sequence[Track], road: Road | None = None, /) -> None:
        """Do nothing."""


class _Mot:
    def __init__(self, file: TextIO) -> None:
        self._file = file

    def write(self, frame: Frame, tracks: Sequence[Track], *_: object) -> None:
        for track in tracks:
            box = track.box
            self._file.write(
                f"{frame.index + 1},{track.id},{box.x + 1},{box.y + 1},{box.width},{box.height},"
                "1,-1,-1,-1\n"
            )


class _Csv:
    def __init__(self, file: TextIO) -> None:
        self._rows = csv.writer(file, lineterminator="\n")
        self._rows.writerow(["frame", "time", "id", "x", "y", "width", "height", "from_match"])

    def write(self, frame: Frame, tracks: Sequence[Track], *_: object) -> None:
        for track in tracks:
            box = track.box
            place = (box.x, box.y, box.width, box.height)
            time = f"{float(frame.time):.6f}"
            self._rows.writerow([frame.index, time, track.id, *place, int(track.from_match)])


class _JsonLines:
    def __init__(self, file: TextIO) -> None:
        self._file = file

    def write(self, frame: Frame, tracks: Sequence[Track], road: Road | None = None, /) -> None:
        boxes = [
            {
                "id": track.id,
                "x": track.box.x,
                "y": track.box.y,
                "width": track.box.width,
                "height": track.box.height,
                "from_match": track.from_match,
            }
            for track in tracks
        ]
        record: dict[str, Any] = {
            "frame": frame.index,
            "time": round(float(frame.time), 6),
            "tracks": boxes,
        }
        if road:
            record["lane"] = lane_record(road.lane)
        self._file.write(json.dumps(record) + "\n")


_FORMATS: dict[str, Callable[[TextIO], TrackWriter]] = {
    ".txt": _Mot,
    ".csv": _Csv,
    ".jsonl": _JsonLines,
}
TRACK_SUFFIXES = tuple(_FORMATS)


def check_suffix(path: Path) -> None:
    """Raise `OutputError` where the suffix names no format of tracks."""
    if path.suffix.lower() not in TRACK_SUFFIXES:
        raise OutputError(f"{path}: tracks are written as {', '.join(TRACK_SUFFIXES)}")


@contextmanager
def track_writer(path: Path | None) -> Iterator[TrackWriter]:
    """Give a writer for `path` (None: of nothing); the file appears when the block ends well.

    Raises
    ------
    OutputError
        The suffix is unknown, or the file cannot be written.
    """
    if path is None:
        yield NoTracks()
        return
    check_suffix(path)
    with (
        replacing(path) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        yield _FORMATS[path.suffix.lower()](file)

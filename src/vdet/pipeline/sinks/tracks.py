"""The sink `tracks`: the shown boxes of each frame as text; the suffix chooses the format.

| suffix   | a line is          | columns                                                          |
|----------|--------------------|------------------------------------------------------------------|
| `.txt`   | a box              | `frame, id, left, top, width, height, score, -1, -1, -1`         |
| `.csv`   | a box              | `frame,time,id,x,y,width,height,score,predicted`, with a heading |
| `.jsonl` | a frame, even one  | `frame`, `time`, `tracks`: a list of objects with `id`, `x`, `y`,|
|          | without a box      | `width`, `height`, `score`, `predicted`; with lanes also `lane`  |

The path `-` stands for standard output, as `.jsonl`, frame by frame as they are done.

In `.csv` and `.jsonl` frames count from 0 at the start of the video, `time` is in seconds, and
`x, y` is the top-left pixel of the box, counted from 0. `.txt` has no heading; its frames and
pixels count from 1, as in MOTChallenge (Milan et al., "MOT16", 2016). `score` is 0 to 1: the share
of boxes with such a score that are vehicles. `predicted` means that the detector did not see the
vehicle in this frame.

Boxes are in pixels of the input frame, even if the frame is drawn undistorted, so they can be
compared with labels of the input. `lane` is null if no lane is shown, else an object with `radius`
(metres, null on a straight road), `offset` (of the camera from the middle of the lane, metres,
positive to the right), `width` (metres), `left` and `right`: each line as `[[x, y], …]`, pixels of
the undistorted frame counted from 0, the nearest point first.
"""

import csv
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self, TextIO

from vdet.lanes.lane import lane_record
from vdet.pipeline.result import FrameResult
from vdet.pipeline.sinks.protocol import STANDARD_OUTPUT, SinkContext, SinkKind

Write = Callable[[FrameResult], None]


def _mot(file: TextIO) -> Write:
    def write(result: FrameResult) -> None:
        for track in result.tracks:
            box = track.box
            place = f"{box.x + 1},{box.y + 1},{box.width},{box.height}"
            number = result.frame.index + 1
            file.write(f"{number},{track.id},{place},{track.score:.4f},-1,-1,-1\n")

    return write


def _csv(file: TextIO) -> Write:
    rows = csv.writer(file, lineterminator="\n")
    place = ("x", "y", "width", "height")
    rows.writerow(["frame", "time", "id", *place, "score", "predicted"])

    def write(result: FrameResult) -> None:
        time = f"{float(result.frame.time):.6f}"
        for track in result.tracks:
            values = [getattr(track.box, name) for name in place]
            score = f"{track.score:.4f}"
            rows.writerow(
                [result.frame.index, time, track.id, *values, score, int(track.predicted)]
            )

    return write


def _json_lines(file: TextIO) -> Write:
    def write(result: FrameResult) -> None:
        record: dict[str, Any] = {
            "frame": result.frame.index,
            "time": round(float(result.frame.time), 6),
            "tracks": [
                {
                    "id": track.id,
                    "x": track.box.x,
                    "y": track.box.y,
                    "width": track.box.width,
                    "height": track.box.height,
                    "score": round(track.score, 4),
                    "predicted": track.predicted,
                }
                for track in result.tracks
            ],
        }
        if result.road:
            record["lane"] = lane_record(result.road.lane)
        file.write(json.dumps(record) + "\n")

    return write


_FORMATS: dict[str, Callable[[TextIO], Write]] = {
    ".txt": _mot,
    ".csv": _csv,
    ".jsonl": _json_lines,
}


class TrackSink:
    """Writes the shown tracks of each frame."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        self._path = path
        self._files = context.files
        self._file: TextIO | None = None

    def __enter__(self) -> Self:
        if self._path == STANDARD_OUTPUT:
            self._write = _json_lines(sys.stdout)
        else:
            self._file = self._files.stage(self._path).open("w", encoding="utf-8", newline="")
            self._write = _FORMATS[self._path.suffix.lower()](self._file)
        return self

    def __exit__(self, *raised: object) -> None:
        if self._file is not None:
            self._file.close()
        else:
            sys.stdout.flush()

    def write(self, result: FrameResult) -> None:
        """Add the tracks of a frame, and its lane if the format has it."""
        self._write(result)


TRACKS = SinkKind(TrackSink, tuple(_FORMATS), "tracks", writes_standard_output=True)

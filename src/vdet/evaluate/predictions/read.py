"""The tracks found in a video, in whichever of the three formats they are."""

from collections.abc import Callable, Sequence
from pathlib import Path

from vdet.errors import TruthError
from vdet.evaluate.labelled_video import LabelledVideo
from vdet.evaluate.mot import result_rows
from vdet.evaluate.predictions.csv_table import csv_rows
from vdet.evaluate.predictions.json_records import json_records, rows_of
from vdet.evaluate.rows import collect
from vdet.evaluate.text import read_text


def read_predictions(path: Path) -> LabelledVideo:
    """Read tracks; the suffix tells the format.

    * `.txt`: MOTChallenge results: frame, id, left, top, width, height, confidence, -1, -1, -1;
      frames and pixels count from 1. No line at all means that nothing was found.
    * `.csv`: a header with at least frame, time, id, x, y, width, height; frames and pixels count
      from 0.
    * `.jsonl`: a record for every frame of the video with frame, time and tracks, counted alike.

    Times are in seconds and give the rate, where two are known. Only `.txt` has confidences; the
    scores of the others are 1.

    Raises
    ------
    TruthError
        The file cannot be read, has another suffix, or has a mistake; the message names the line.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise TruthError(f"{path}: is not tracks; give a .txt, .csv or .jsonl file")
    return reader(path, read_text(path))


def _read_txt(path: Path, text: str) -> LabelledVideo:
    return collect(path, result_rows(path, text))


def _read_csv(path: Path, text: str) -> LabelledVideo:
    timed = list(csv_rows(path, text))
    rate = _rate([(row.frame, time) for row, time in timed])
    return collect(path, [row for row, _ in timed], rate=rate)


def _read_jsonl(path: Path, text: str) -> LabelledVideo:
    records = list(json_records(path, text))
    if not records:
        raise TruthError(f"{path}: is empty; it should have a record for every frame")
    rows = [row for line, record in records for row in rows_of(line, record)]
    rate = _rate([(record.frame, record.time) for _, record in records])
    return collect(path, rows, frame_count=records[-1][1].frame + 1, rate=rate)


_READERS: dict[str, Callable[[Path, str], LabelledVideo]] = {
    ".txt": _read_txt,
    ".csv": _read_csv,
    ".jsonl": _read_jsonl,
}


def _rate(times: Sequence[tuple[int, float]]) -> float | None:
    """Return frames a second over the earliest to the latest of `(frame, seconds)`."""
    if not times:
        return None
    (first, start), (last, end) = min(times), max(times)
    return (last - first) / (end - start) if last > first and end > start else None

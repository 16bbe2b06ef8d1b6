"""MOTChallenge text: comma-separated columns; frames and pixels count from 1.

Source: Milan et al., "MOT16: A Benchmark for Multi-Object Tracking", 2016, tables 3 and 4.
"""

import logging
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from vdet.labels.formats import Format
from vdet.labels.label import Label, SavedTracks, from_size
from vdet.labels.parsing import label_lines, parse_number, parse_whole
from vdet.track.track import FrameTracks

_log = logging.getLogger("vdet")
_MAX_CLASSES = 100  # more are positions, in the eighth column of results
_TRUTH_COLUMNS, _RESULT_COLUMNS = 9, 10


def _lines(frame: FrameTracks) -> Iterator[str]:
    """Yield a line for each box: frame, id, left, top, width, height, score, -1, -1, -1."""
    for track in frame.tracks:
        x, y, width, height = track.box.xywh
        yield (
            f"{frame.index + 1},{track.id},{x + 1},{y + 1},{width},{height},{track.score:.4f},"
            "-1,-1,-1\n"
        )


def read_mot(path: Path, data: bytes) -> SavedTracks:
    """Read results or truth.

    Results have ten columns: frame, id, left, top, width, height, confidence, -1, -1, -1. Truth has
    nine, as in `gt.txt`: frame, id, left, top, width, height, flag, class, visibility. Flag 0 marks
    an ignore region, 1 a vehicle. The class is not used, because its numbers differ between tools;
    neither is the visibility. Several classes give a warning (logger "vdet"). Columns may also be
    separated by spaces.

    Raises
    ------
    TruthError
        A line has a wrong number of columns, or another one than the first line, a column is not a
        number, or a flag is neither 0 nor 1.
    """
    counts, classes = (_TRUTH_COLUMNS, _RESULT_COLUMNS), set[str]()
    separator = "," if b"," in data.lstrip().partition(b"\n")[0] else None
    parse = partial(_label, classes=classes)
    labels = label_lines(path, data, parse, form="MOTChallenge", counts=counts, separator=separator)
    saved = SavedTracks(tuple(labels))
    if 1 < len(classes) <= _MAX_CLASSES:
        numbers = ", ".join(sorted(classes, key=int))
        _log.warning(
            "%s: column 8 has the classes %s, which are all read as vehicles; keep only the rows "
            "of vehicles",
            path,
            numbers,
        )
    return saved


def _label(line: int, columns: Sequence[str], *, classes: set[str]) -> Label:
    frame, id_ = map(parse_whole, columns[:2])
    left, top, width, height, flag_or_score, *_ = map(parse_number, columns[2:])
    is_truth = len(columns) == _TRUTH_COLUMNS
    if is_truth and flag_or_score not in {0, 1}:
        raise ValueError(
            f"with nine columns, column 7 must be a flag, 0 or 1, but is {flag_or_score:g}; a "
            "results file needs ten columns"
        )
    if flag_or_score and columns[7].strip().isdecimal():
        classes.add(columns[7].strip())
    return Label(
        position=line,
        box=from_size(left - 1, top - 1, width, height),
        frame=frame,
        id=id_,
        score=1.0 if is_truth else flag_or_score,
        ignored=is_truth and flag_or_score == 0,
    )


MOT = Format("MOTChallenge", ".txt", read_mot, _lines)

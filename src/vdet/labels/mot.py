"""MOTChallenge text: comma-separated columns; frames and pixels count from 1.

Source: Milan et al., "MOT16: A Benchmark for Multi-Object Tracking", 2016, tables 3 and 4.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from vdet.labels.formats import Format
from vdet.labels.label import Label, SavedTracks, from_size, limited
from vdet.labels.parsing import label_lines, parse_number, parse_whole
from vdet.track.track import FrameTracks

_TRUTH_COLUMNS, _RESULT_COLUMNS = 9, 10


def _lines(frame: FrameTracks) -> Iterator[str]:
    """Yield a line for each box: frame, id, left, top, width, height, score, -1, -1, -1."""
    for track in frame.tracks:
        x, y, width, height = track.box.xywh
        place = f"{x + 1},{y + 1},{width},{height}"
        yield f"{frame.index + 1},{track.id},{place},{track.score:.4f},-1,-1,-1\n"


def read_mot(path: Path, data: bytes) -> SavedTracks:
    """Read results or truth.

    Results have ten columns: frame, id, left, top, width, height, confidence, -1, -1, -1. Truth has
    nine, as in `gt.txt`: frame, id, left, top, width, height, flag, class, visibility. Flag 0 marks
    an ignore region, 1 a vehicle. The class is not used, because its numbers differ between tools;
    neither is the visibility.

    Raises
    ------
    TruthError
        A line has a wrong number of columns, or another one than the first line, a column is not a
        number, or a flag is neither 0 nor 1.
    """
    counts = _TRUTH_COLUMNS, _RESULT_COLUMNS
    labels = label_lines(path, data, _label, form="MOTChallenge", counts=counts, separator=",")
    return SavedTracks(limited(path, labels))


def _label(place: int, columns: Sequence[str]) -> Label:
    frame, id_ = map(parse_whole, columns[:2])
    left, top, width, height, seventh, *_ = map(parse_number, columns[2:])
    is_truth = len(columns) == _TRUTH_COLUMNS
    if is_truth and seventh not in {0, 1}:
        what = f"with nine columns, column 7 must be a flag, 0 or 1, but is {seventh:g}"
        raise ValueError(f"{what}; a results file needs ten columns")
    box, score = from_size(left - 1, top - 1, width, height), 1.0 if is_truth else seventh
    return Label(place, box, None, frame, id_, score, ignored=is_truth and seventh == 0)


MOT = Format("MOTChallenge", ".txt", read_mot, _lines)

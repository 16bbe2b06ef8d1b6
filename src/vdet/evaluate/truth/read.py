"""The truth of a video, in whichever of the known formats it is."""

from collections.abc import Callable, Iterable
from pathlib import Path

from vdet.errors import TruthError
from vdet.evaluate.labelled_video import LabelledVideo
from vdet.evaluate.mot import truth_rows
from vdet.evaluate.rows import Row, collect
from vdet.evaluate.text import numbered_lines, read_text
from vdet.evaluate.truth.cvat import cvat_rows
from vdet.evaluate.truth.kitti import kitti_rows

_FORMATS = "MOTChallenge gt.txt, KITTI tracking labels or CVAT for video 1.1"


def read_truth(path: Path, *, frame_count: int | None = None) -> LabelledVideo:
    """Read truth; the format is told by the first line: XML, commas or spaces.

    Parameters
    ----------
    path
        A MOTChallenge `gt.txt`, KITTI tracking labels or CVAT for video 1.1.
    frame_count
        Frames of the video, where known: a frame beyond them is refused.

    Raises
    ------
    TruthError
        The file cannot be read, is empty, or has a mistake; the message names the first one's line.
    """
    text = read_text(path)
    return collect(path, _reader(path, text)(path, text), frame_count=frame_count)


def _reader(path: Path, text: str) -> Callable[[Path, str], Iterable[Row]]:
    _, first = next(numbered_lines(text), (0, ""))
    if not first:
        raise TruthError(f"{path}: is empty; give {_FORMATS}")
    if first.startswith("<"):
        return cvat_rows
    return truth_rows if "," in first else kitti_rows

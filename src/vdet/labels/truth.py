"""The truth of a video: which labelled boxes are vehicles, and which are ignore regions."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from vdet.errors import TruthError
from vdet.labels.mot import MOT, flagged
from vdet.labels.parsing import read_bytes
from vdet.labels.registry import FORMATS, recognise
from vdet.labels.roles import Role, role_of
from vdet.labels.rows import Row, line_error
from vdet.labels.video import LabelledVideo, checked_video

_FORMATS = ", ".join(each.name for each in FORMATS)


def read_truth(path: Path, *, frame_count: int | None = None) -> LabelledVideo:
    """Read truth in any format of tracks.

    The label of a box tells its role: car, van, truck and bus are vehicles even if hidden or cut
    off; tram, trailer, motorcycle and what is called ignored are ignore regions; pedestrians and
    cyclists are skipped. Boxes without a label are vehicles. In MOTChallenge flag 0 marks an ignore
    region, also in the older form with ten columns.

    Parameters
    ----------
    path
        MOTChallenge `gt.txt`, KITTI tracking labels, CVAT for video 1.1 (also the zip file that
        CVAT exports), COCO with tracks, YOLO with tracks, or `.csv` or `.jsonl` of vdet.
    frame_count
        Number of frames of the video if known; boxes in later frames are refused.

    Raises
    ------
    TruthError
        The file cannot be read, is empty, or has a mistake; the message names its place.
    """
    data = read_bytes(path)
    if not data.strip():
        raise TruthError(f"{path}: is empty; give {_FORMATS}")
    form = recognise(path, data)
    rows: Iterable[Row] = form.read(path, data).rows
    if form is MOT:
        rows = (flagged(path, row) for row in rows)
    return checked_video(path, _with_roles(path, rows), frame_count=frame_count)


def _with_roles(path: Path, rows: Iterable[Row]) -> Iterator[Row]:
    """Yield vehicles and ignore regions, by their labels."""
    for row in rows:
        try:
            role = Role.VEHICLE if row.label is None else role_of(row.label)
        except ValueError as error:
            raise line_error(path, row.line, str(error)) from error
        if role is not Role.OTHER:
            yield replace(row, score=1.0, ignored=row.ignored or role is Role.IGNORED)

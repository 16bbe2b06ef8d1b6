"""All formats of tracks: which one a file has, and its tracks."""

import io
from dataclasses import replace
from pathlib import Path

from vdet.archives import ArchiveError, list_members
from vdet.errors import TruthError
from vdet.labels.coco import COCO
from vdet.labels.csv_table import CSV
from vdet.labels.cvat import CVAT, MEMBER
from vdet.labels.json_lines import JSON_LINES
from vdet.labels.kitti import KITTI
from vdet.labels.mot import MOT
from vdet.labels.parsing import numbered_lines, read_bytes, text_of
from vdet.labels.protocol import Format
from vdet.labels.roles import is_region
from vdet.labels.rows import checked_rows
from vdet.labels.saved import SavedTracks
from vdet.labels.yolo import YOLO

FORMATS = (MOT, CSV, JSON_LINES, COCO, CVAT, KITTI, YOLO)
ENDINGS = tuple(each.ending for each in FORMATS)

_UNCLEAR = {MOT, CSV}
"""Formats whose ending is that of others too: the first line tells."""


def format_for(path: Path) -> Format | None:
    """Return the format that the name of a file ends in; None if it is none of them."""
    name = path.name.lower()
    fitting = [each for each in FORMATS if name.endswith(each.ending)]
    return max(fitting, key=lambda each: len(each.ending), default=None)


def recognise(path: Path, data: bytes) -> Format:
    """Return the format of a file, by its name, or by its content where the name leaves it open.

    Raises
    ------
    TruthError
        The file is empty, and its name does not end as that of a format.
    """
    by_name = format_for(path)
    if by_name and by_name not in _UNCLEAR:
        return by_name
    if data.startswith(b"PK"):
        return _in_archive(path, data)
    _, first = next(numbered_lines(text_of(path, data)), (0, ""))
    if not first:
        if by_name is None:
            raise TruthError(f"{path}: is empty; give tracks or truth, as in {', '.join(ENDINGS)}")
        return by_name
    return _of_first_line(first)


def _of_first_line(first: str) -> Format:
    if first[0] in "<{":
        return CVAT if first[0] == "<" else COCO
    if "," not in first:
        return KITTI
    return MOT if first[0] in "0123456789+-." else CSV


def _in_archive(path: Path, data: bytes) -> Format:
    try:
        return CVAT if MEMBER in list_members(io.BytesIO(data)) else YOLO
    except ArchiveError as error:
        raise TruthError(f"{path}: {error}") from error


def read_tracks(path: Path, rate: float | None = None) -> SavedTracks:
    """Read the tracks of a video from a file of any format; ignore regions are left out.

    Parameters
    ----------
    rate
        Frames per second, for formats without times; None: their frames have no times.

    Raises
    ------
    TruthError
        The file cannot be read, or has a mistake; the message names its place.
    """
    data = read_bytes(path)
    saved = recognise(path, data).read(path, data)
    vehicles = (row for row in saved.rows if not (row.ignored or is_region(row.label)))
    saved = replace(saved, rows=checked_rows(path, vehicles))
    return saved if rate is None else saved.at_rate(rate)

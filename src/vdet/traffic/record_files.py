"""Records of vehicles as files: a row or an item each; and one file over those of many videos."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from vdet.traffic.records import VehicleRecord
from vdet.traffic.tables import VIDEO, is_json, join, write_json, write_table

_PLACE = ("x", "y", "width", "height")
COLUMNS = (
    *("id", "class", "first", "last", "seconds", "seen", "predicted", "mean_score", "best_score"),
    *("start_x", "start_y", "end_x", "end_y", "length", "length_share"),
    *_PLACE,
)
"""Of `.csv`; x, y, width and height are those of the largest box."""


def write_records(records: Iterable[VehicleRecord], path: Path) -> None:
    """Write the records; the suffix of `path` chooses the format."""
    if is_json(path):
        write_json(path, [_item(record) for record in records])
    else:
        write_table(path, COLUMNS, (_cells(_item(record)) for record in records))


def join_records(outputs: Mapping[str, Path], target: Path) -> None:
    """Write one file over those of many videos, by their names; each record gets its video.

    Errors as of `join`.
    """
    join(outputs, target, COLUMNS, _with_videos)


def _with_videos(videos: Mapping[str, Any]) -> list[dict[str, Any]]:
    return [{VIDEO: name, **item} for name, items in videos.items() for item in items]


def _item(record: VehicleRecord) -> dict[str, Any]:
    return {
        "id": record.id,
        "class": record.class_name,
        "first": round(record.first, 6),
        "last": round(record.last, 6),
        "seconds": round(record.seconds, 3),
        "seen": record.seen,
        "predicted": record.predicted,
        "mean_score": round(record.mean_score, 4),
        "best_score": round(record.best_score, 4),
        "path": {
            "start": [round(value, 1) for value in record.path[0]],
            "end": [round(value, 1) for value in record.path[-1]],
            "length": round(record.length, 1),
            "length_share": round(record.share, 4),
        },
        "largest": dict(zip(_PLACE, record.largest.xywh, strict=True)),
    }


def _cells(value: Any) -> Iterator[Any]:
    """Yield the values of an item, and those in its values, in the order of `COLUMNS`."""
    if isinstance(value, dict):
        value = value.values()
    elif not isinstance(value, list):
        yield value
        return
    for each in value:
        yield from _cells(each)

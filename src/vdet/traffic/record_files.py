"""Records of vehicles as files: a row or an item each; and one file over those of many videos."""

import csv
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from vdet.errors import OutputError
from vdet.traffic.records import VehicleRecord

COLUMNS = (
    *("id", "class", "first", "last", "seconds", "seen", "predicted", "mean_score", "best_score"),
    *("start_x", "start_y", "end_x", "end_y", "length", "length_share"),
    *("x", "y", "width", "height"),
)
"""Of `.csv`; x, y, width and height are those of the largest box."""

_VIDEO = "video"


def write_records(records: Iterable[VehicleRecord], path: Path) -> None:
    """Write the records; the suffix of `path` chooses the format."""
    _FORMATS[path.suffix.lower()].write(map(_item, records), path)


def join_records(outputs: Mapping[str, Path], target: Path) -> None:
    """Write one file over those of many videos, by their names; each record gets its video.

    Raises
    ------
    OutputError
        One of `outputs` is no such file.
    """
    form = _FORMATS[target.suffix.lower()]
    form.write(_items(outputs, form.read), target, video=True)


def _items(
    outputs: Mapping[str, Path], read: Callable[[Path], Iterable[Mapping[str, Any]]]
) -> Iterator[dict[str, Any]]:
    for name, path in outputs.items():
        try:
            for item in read(path):
                yield {_VIDEO: name, **item}
        except (ValueError, TypeError, csv.Error) as error:
            raise OutputError(
                f"{path}: has no records of vehicles; remove it, and run again"
            ) from error


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
        "largest": dict(zip(("x", "y", "width", "height"), record.largest.xywh, strict=True)),
    }


class _Csv:
    @staticmethod
    def write(items: Iterable[Mapping[str, Any]], path: Path, *, video: bool = False) -> None:
        # The name of a video may be no valid text.
        with path.open("w", encoding="utf-8", errors="backslashreplace", newline="") as file:
            columns = (_VIDEO, *COLUMNS) if video else COLUMNS
            rows = csv.DictWriter(file, columns, lineterminator="\n")
            rows.writeheader()
            rows.writerows(map(_flat, items))

    @staticmethod
    def read(path: Path) -> Iterator[Mapping[str, Any]]:
        with path.open(encoding="utf-8", newline="") as file:
            rows = csv.DictReader(file, strict=True)
            if tuple(rows.fieldnames or ()) != COLUMNS:
                raise ValueError("other columns")
            yield from rows


def _flat(item: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns of an item; those that were read are columns already."""
    row = dict(item)
    if path := row.pop("path", None):
        row |= {"start_x": path["start"][0], "start_y": path["start"][1]}
        row |= {"end_x": path["end"][0], "end_y": path["end"][1]}
        row |= {"length": path["length"], "length_share": path["length_share"]}
    row |= row.pop("largest", {})
    return row


class _Json:
    @staticmethod
    def write(items: Iterable[Mapping[str, Any]], path: Path, *, video: bool = False) -> None:  # noqa: ARG004
        text = json.dumps(list(items), indent=2, allow_nan=False)
        path.write_text(text + "\n", encoding="utf-8")

    @staticmethod
    def read(path: Path) -> Iterator[Mapping[str, Any]]:
        for item in json.loads(path.read_text(encoding="utf-8")):
            yield {**item}


_FORMATS: dict[str, type[_Csv | _Json]] = {".csv": _Csv, ".json": _Json}
SUFFIXES = tuple(_FORMATS)

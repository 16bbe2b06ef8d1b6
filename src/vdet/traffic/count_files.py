"""Counts as files: `.csv` has the events, `.json` the events and all totals.

A file over several videos has the same columns with `video` before them, or the counts of each
video and the sum of all totals.
"""

import csv
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from vdet.config.places import CountSettings
from vdet.errors import ConfigError, TruthError
from vdet.labels.reading import read_tracks
from vdet.track.track import FrameTracks
from vdet.traffic.counter import VehicleCounter
from vdet.traffic.events import Event
from vdet.traffic.layout import lay_out
from vdet.traffic.totals import Counts, Total

SUFFIXES = (".csv", ".json")

_COLUMNS = ("time", "frame", "name", "direction", "id", "class", "score", "stitched", "seconds")


def count_file(
    path: Path,
    settings: CountSettings,
    size: tuple[int, int] | None = None,
    rate: float | None = None,
) -> Counts:
    """Count the vehicles of a file of tracks at the lines and in the zones of the settings.

    Parameters
    ----------
    size
        Width and height of the frames, pixels; None: as the file says, else as the lines say.
    rate
        Frames per second, for a file without times.

    Raises
    ------
    TruthError
        The file cannot be used, or has no times.
    ConfigError
        The lines do not fit the frames, or the size of the frames is not known.
    """
    saved = read_tracks(path, rate)
    if not saved.has_times:
        raise TruthError(f"{path}: has no times; give the frames per second, as in --rate 25")
    return count_frames(saved.frames, settings, size or saved.size)


def count_frames(
    frames: Iterable[FrameTracks], settings: CountSettings, size: tuple[int, int] | None = None
) -> Counts:
    """Count the vehicles in the tracks of each frame; arguments and errors as of `count_file`."""
    size = size or settings.size
    if not settings:
        raise ConfigError("there is nothing to count at; give lines or zones")
    if size is None:
        raise ConfigError("the lines are shares of the frame; give --size, as in 1280x720")
    counter = VehicleCounter(lay_out(settings, *size))
    for frame in frames:
        counter.update(frame)
    return counter.counts()


def write_counts(path: Path, counts: Counts) -> None:
    """Write the counts of one video."""
    if path.suffix.lower() == ".json":
        _write_json(path, _plain(counts))
    else:
        _write_table(path, _COLUMNS, (_cells(event) for event in counts.events))


def write_counts_of_all(path: Path, videos: Mapping[str, Counts]) -> None:
    """Write the counts of several videos, by their names."""
    if path.suffix.lower() == ".json":
        by_name = {name: _plain(counts) for name, counts in videos.items()}
        sums = [asdict(each) for each in sum_totals(videos.values())]
        _write_json(path, {"totals": sums, "videos": by_name})
    else:
        rows = (
            (name, *_cells(event)) for name, counts in videos.items() for event in counts.events
        )
        _write_table(path, ("video", *_COLUMNS), rows)


def join_counts(outputs: Mapping[str, Path], path: Path) -> None:
    """Write the counts of several videos into one file, from the file of each of the same form."""
    if path.suffix.lower() == ".json":
        values = {name: json.loads(each.read_text("utf-8")) for name, each in outputs.items()}
        sums = sum_totals(
            (Counts((), tuple(Total(**total) for total in each["totals"]), (), ()))
            for each in values.values()
        )
        _write_json(path, {"totals": [asdict(each) for each in sums], "videos": values})
        return
    _write_table(path, ("video", *_COLUMNS), _rows_of(outputs))


def sum_totals(videos: Iterable[Counts]) -> tuple[Total, ...]:
    """Return the totals of all videos together."""
    sums: dict[tuple[str, str], Total] = {}
    for counts in videos:
        for each in counts.totals:
            old = sums.get((each.name, each.direction), Total(each.name, each.direction, 0, {}))
            names = sorted(old.classes.keys() | each.classes.keys())
            classes = {name: old.classes.get(name, 0) + each.classes.get(name, 0) for name in names}
            added = Total(each.name, each.direction, old.count + each.count, classes)
            sums[each.name, each.direction] = added
    return tuple(sums.values())


def _rows_of(outputs: Mapping[str, Path]) -> Iterator[list[str]]:
    for name, each in outputs.items():
        with each.open(encoding="utf-8", newline="") as file:
            rows = csv.reader(file)
            next(rows, None)
            yield from ([name, *row] for row in rows)


def _plain(counts: Counts) -> dict[str, Any]:
    return {
        "events": [dict(zip(_COLUMNS, _values(event), strict=True)) for event in counts.events],
        "totals": [asdict(total) for total in counts.totals],
        "minutes": [asdict(minute) for minute in counts.minutes],
        "zones": [asdict(stay) for stay in counts.zones],
    }


def _values(event: Event) -> tuple[Any, ...]:
    return (
        *(event.time, event.frame, event.name, event.direction, event.id, event.class_name),
        *(event.score, event.stitched, event.seconds),
    )


def _cells(event: Event) -> tuple[Any, ...]:
    time, *middle, score, stitched, seconds = _values(event)
    shown = "" if seconds is None else f"{seconds:.3f}"
    return f"{time:.3f}", *middle, f"{score:.4f}", int(stitched), shown


def _write_table(path: Path, columns: Iterable[str], rows: Iterable[Iterable[Any]]) -> None:
    # The name of a video may be no valid text.
    with path.open("w", encoding="utf-8", errors="backslashreplace", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(columns)
        table.writerows(rows)


def _write_json(path: Path, values: Any) -> None:
    text = json.dumps(values, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    path.write_text(text, encoding="utf-8", errors="backslashreplace")

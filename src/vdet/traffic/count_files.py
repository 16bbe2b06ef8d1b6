"""Counts as files: `.csv` has the events, `.json` the events and all totals.

A file over several videos has the same columns with `video` before them, or the counts of each
video and the sum of all totals.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, astuple, replace
from pathlib import Path
from typing import Any

from vdet.config.places import CountSettings
from vdet.errors import ConfigError, TruthError
from vdet.labels.reading import read_tracks
from vdet.track.track import FrameTracks
from vdet.traffic.counter import VehicleCounter
from vdet.traffic.layout import lay_out
from vdet.traffic.tables import VIDEO, is_json, join, write_json, write_table
from vdet.traffic.totals import Counts, Event, Total

_COLUMNS = ("time", "frame", "name", "direction", "id", "class", "score", "stitched", "seconds")
"""Of `.csv`: the fields of an event in their order."""
_FORMS = {"time": ".3f", "score": ".4f", "stitched": "d", "seconds": ".3f"}


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
    if is_json(path):
        write_json(path, _plain(counts))
    else:
        write_table(path, _COLUMNS, map(_cells, counts.events))


def write_counts_of_all(path: Path, videos: Mapping[str, Counts]) -> None:
    """Write the counts of several videos, by their names."""
    if is_json(path):
        write_json(path, _joined({name: _plain(counts) for name, counts in videos.items()}))
    else:
        rows = ((name, *_cells(event)) for name, each in videos.items() for event in each.events)
        write_table(path, (VIDEO, *_COLUMNS), rows)


def join_counts(outputs: Mapping[str, Path], path: Path) -> None:
    """Write the counts of several videos into one file, from the file of each of the same form.

    Errors as of `join`.
    """
    join(outputs, path, _COLUMNS, _joined)


def sum_totals(totals: Iterable[Total]) -> tuple[Total, ...]:
    """Return the sums of totals of the same name and direction."""
    sums: dict[tuple[str, str], Total] = {}
    for each in totals:
        old = sums.get((each.name, each.direction), Total(each.name, each.direction, 0, {}))
        classes = Counter(old.classes) + Counter(each.classes)
        added = replace(old, count=old.count + each.count, classes=dict(sorted(classes.items())))
        sums[each.name, each.direction] = added
    return tuple(sums.values())


def _joined(videos: Mapping[str, Any]) -> dict[str, Any]:
    totals = sum_totals(Total(**total) for each in videos.values() for total in each["totals"])
    return {"totals": [asdict(each) for each in totals], "videos": videos}


def _plain(counts: Counts) -> dict[str, Any]:
    events = (dict(zip(_COLUMNS, astuple(event), strict=True)) for event in counts.events)
    return asdict(counts) | {"events": list(events)}


def _cells(event: Event) -> list[str]:
    return [
        "" if value is None else format(value, _FORMS.get(column, ""))
        for column, value in zip(_COLUMNS, astuple(event), strict=True)
    ]

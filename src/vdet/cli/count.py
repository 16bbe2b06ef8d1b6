"""`vdet count`: count the vehicles of track files at lines and in zones."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from vdet.cli.command import Command
from vdet.cli.messages import print_lines, progress_bar
from vdet.cli.options import (
    PATH,
    lines_option,
    overwrite_option,
    read_settings,
    settings_options,
)
from vdet.config.places import CountSettings
from vdet.errors import TruthError
from vdet.files import check_output, printable, staged
from vdet.labels.registry import read_tracks
from vdet.traffic.count_files import SUFFIXES, sum_totals, write_counts, write_counts_of_all
from vdet.traffic.counter import count_events
from vdet.traffic.layout import lay_out
from vdet.traffic.totals import Counts, Total

_SIZE = re.compile(r"([1-9][0-9]{0,4})[x×]([1-9][0-9]{0,4})", re.ASCII)


class SizeType(click.ParamType):  # type: ignore[type-arg]  # generic from click 8.4 on
    """Width and height in pixels, as in 1280x720."""

    name = "size"

    def convert(
        self, value: Any, param: click.Parameter | None, context: click.Context | None
    ) -> tuple[int, int]:
        """Return width and height."""
        if isinstance(value, tuple):
            return value
        match = _SIZE.fullmatch(str(value).lower())
        if not match:
            self.fail(
                f"{value!r} is no size; give width and height, as in 1280x720", param, context
            )
        return int(match[1]), int(match[2])


@click.command(
    cls=Command,
    examples=(
        "vdet count tracks.jsonl --lines lines.yaml",
        "vdet count found/*.csv --lines lines.yaml --counts counts.json",
    ),
)
@click.argument("tracks", nargs=-1, required=True, type=PATH, metavar="TRACKS...")
@lines_option
@click.option(
    "--counts",
    "target",
    type=PATH,
    metavar="FILE",
    help="Write the counts: .csv has the events, .json also all totals. Those of several TRACKS go "
    "into one file.",
)
@click.option(
    "--size",
    type=SizeType(),
    metavar="WIDTHxHEIGHT",
    show_default="as TRACKS say, else the size that the lines are given for",
    help="Size of the frames of the video, pixels.",
)
@click.option(
    "--rate",
    type=click.FloatRange(min=0, min_open=True),
    metavar="FPS",
    show_default="from the times in TRACKS",
    help="Frames per second of the video, for TRACKS without times.",
)
@settings_options("counts.confirmed=0.5")
@overwrite_option
@click.pass_obj
def count(
    quiet: bool,
    *,
    tracks: tuple[Path, ...],
    lines: Path | None,
    target: Path | None,
    size: tuple[int, int] | None,
    rate: float | None,
    config_name: str | None,
    assignments: tuple[str, ...],
    overwrite: bool,
) -> None:
    """Count the vehicles of track files at lines and in zones.

    TRACKS are files of vdet detect-video --tracks. Nothing is detected again, and the counts are
    the same as those of detect-video --counts.
    """
    settings = read_settings(config_name, assignments, lines=lines).counts
    if not settings:
        raise click.UsageError("there is nothing to count at; give --lines FILE")
    if target is not None:
        if target.suffix.lower() not in SUFFIXES:
            raise click.UsageError(f"--counts: counts are written as {', '.join(SUFFIXES)}")
        check_output(target, overwrite=overwrite, inputs=tracks)
    with progress_bar(" files", quiet=quiet) as progress:
        advance = progress(len(tracks) if len(tracks) > 1 else None)
        videos = {}
        for path in tracks:
            videos[str(path)] = _count(path, settings, size, rate)
            advance(1)
    if target is not None:
        with staged(target, overwrite=overwrite) as temporary:
            if len(tracks) == 1:
                write_counts(temporary, *videos.values())
            else:
                write_counts_of_all(temporary, videos)
    print_lines(*_table(videos))


def _count(
    path: Path, settings: CountSettings, size: tuple[int, int] | None, rate: float | None
) -> Counts:
    saved = read_tracks(path, rate)
    if not saved.has_times:
        raise TruthError(f"{path}: has no times; give the frames per second, as in --rate 25")
    layout = lay_out(settings, *(size or saved.size or _own_size(settings)))
    zones = [zone.name for zone in layout.zones]
    return Counts.of(count_events(saved.frames, layout), layout.keys, zones)


def _own_size(settings: CountSettings) -> tuple[int, int]:
    """Return the size of frames that the lines are given for."""
    if settings.size is None:
        raise click.UsageError("the lines are shares of the frame; give --size, as in 1280x720")
    return settings.size


def _table(videos: Mapping[str, Counts]) -> list[str]:
    """Return the totals of each file, and of all where there are several."""
    totals = {name: counts.totals for name, counts in videos.items()}
    if len(videos) > 1:
        totals["all files"] = sum_totals(videos.values())
    rows: list[Sequence[str]] = [("file", "name", "direction", "count", "classes")]
    for name, each in totals.items():
        rows += [_row(name, total) for total in each]
    if len(videos) == 1:
        rows = [row[1:] for row in rows]
    if not any(row[-1] for row in rows[1:]):
        rows = [row[:-1] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def _row(name: str, total: Total) -> Sequence[str]:
    classes = ", ".join(f"{printable(each)} {count}" for each, count in total.classes.items())
    shown = printable(total.name), printable(total.direction)
    return (printable(name), *shown, str(total.count), classes)

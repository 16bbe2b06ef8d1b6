"""`vdet count`: count the vehicles of track files at lines and in zones."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import print_lines, progress_steps
from vdet.cli.options import option
from vdet.files import check_output, staged

if TYPE_CHECKING:
    from vdet.traffic.counts import Counts


@command(
    "vdet count tracks.jsonl --lines lines.yaml",
    "vdet count found/*.csv --lines lines.yaml --counts counts.json",
)
@click.argument("tracks", nargs=-1, required=True, type=options.PATH, metavar="TRACKS...")
@option(
    "--counts FILE",
    "Write the counts: .csv has the events, .json also all totals. Those of several TRACKS go "
    "into one file.",
    name="target",
)
@option(
    "--size WIDTHxHEIGHT",
    "Size of the frames of the video, pixels.",
    options.parse_pair,
    show_default="as TRACKS say, else the size that the lines are given for",
)
@option(
    "--rate FPS",
    "Frames per second of the video, for TRACKS without times.",
    options.RATE,
    show_default="from the times in TRACKS",
)
@options.settings_options("counts.confirmed=0.5", options.lines_option)
@options.overwrite_option
def count(
    tracks: tuple[Path, ...],
    target: Path | None,
    size: tuple[int, int] | None,
    rate: float | None,
    choice: options.SettingsChoice,
    overwrite: bool,
) -> None:
    """Count the vehicles of track files at lines and in zones.

    TRACKS are files of vdet detect-video --tracks. Nothing is detected again, and the counts are
    the same as those of detect-video --counts.
    """
    settings = choice.read()
    if not settings.counts:
        raise click.UsageError("there is nothing to count at; give --lines FILE")
    from vdet.traffic.counter import count_file
    from vdet.traffic.counts import write_counts
    from vdet.traffic.tables import SUFFIXES

    if target is not None:
        if target.suffix.lower() not in SUFFIXES:
            raise click.UsageError(f"--counts: counts are written as {', '.join(SUFFIXES)}")
        check_output(target, overwrite=overwrite, inputs=[*tracks, *choice.inputs(settings)])
    videos = {}
    with progress_steps(" files") as steps:
        advance = steps("", len(tracks) if len(tracks) > 1 else None)
        for path in tracks:
            videos[str(path)] = count_file(path, settings.counts, size, rate)
            advance(1)
    if target is not None:
        with staged(target, overwrite=overwrite) as temporary:
            write_counts(temporary, videos if len(videos) > 1 else videos[str(tracks[0])])
    print_lines(*_table(videos))


def _table(videos: "Mapping[str, Counts]") -> list[str]:
    """Return the totals of each file, and of all where there are several."""
    from vdet.evaluate.output import table
    from vdet.pages.render import counted
    from vdet.traffic.counts import sum_totals

    totals = {name: counts.totals for name, counts in videos.items()}
    if len(videos) > 1:
        totals["all files"] = sum_totals(each for some in totals.values() for each in some)
    rows = []
    for name, each in totals.items():
        for total in each:
            classes = ", ".join(counted(number, kind) for kind, number in total.classes.items())
            rows.append((name, total.name, total.direction, str(total.count), classes))
    return table(("file", "name", "direction", "count", "classes"), rows)

"""Options of the commands that count at lines and in zones: outputs, intervals and the clock."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import click

from vdet.cli import options
from vdet.cli.options import F, short_form

if TYPE_CHECKING:
    from vdet.config.schema import Settings


def check_counting(settings: "Settings", *, several: bool) -> None:
    """Raise `click.UsageError` where settings do not fit the outputs or the videos."""
    wanted = {sink for sink, _ in options.wanted_outputs()}
    tables = wanted & {"counts", "flows"}
    if tables and not settings.traffic:
        raise click.UsageError(
            f"--{min(tables)} needs lines or zones; add a settings file with -c FILE"
        )
    if settings.input.begin and several:
        raise click.UsageError(
            "input.begin is for one video; for several set a pattern of their names, "
            "camera.clock.pattern"
        )


def counting_options(more: str = "") -> Callable[[F], F]:
    """Add `--counts`, `--flows`, and the short forms `--interval` and `--begin`.

    `more` ends the help of both outputs.
    """
    counts = options.output_option(
        "--counts FILE",
        "Write which vehicles cross lines and visit zones: .csv has the events, .totals.csv, "
        ".wide.csv and .zones.csv have tables by interval, .json has it all. Can be repeated."
        + more,
    )
    flows = options.output_option(
        "--flows FILE",
        "Write how many vehicles go from which line or zone to which: .csv has a row for each "
        "interval, flow and class, .wide.csv a row for each interval, with sums, .matrix.csv is a "
        "matrix, .json has all but the wide one. Can be repeated." + more,
    )
    interval = short_form(
        "--interval TIME",
        "traffic.interval",
        "Interval of tables, and of the bars of a page, as in 5min, 15min or 1h.",
    )
    begin = short_form(
        "--begin TIME", "input.begin", "When the video begins, as in '2026-05-01 07:00+02:00'."
    )
    return lambda command: counts(flows(interval(begin(command))))

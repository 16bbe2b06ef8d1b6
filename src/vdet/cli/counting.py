"""Options of the commands that count at lines and in zones: outputs, intervals and the clock."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from vdet.cli import options
from vdet.cli.options import F, option
from vdet.errors import ConfigError

if TYPE_CHECKING:
    from vdet.config.schema import Settings

_INTERVAL = re.compile(r"([1-9][0-9]{0,4}) ?(s|min|h)", re.ASCII)
_DAY = 24 * 3600  # seconds


@dataclass(frozen=True, slots=True)
class Counting:
    """The values of `counting_options`.

    Attributes
    ----------
    begin
        As of `vdet.traffic.clock.find_clock`.
    interval
        Seconds; None for the whole.
    """

    begin: str | None
    interval: int | None

    def check(self, settings: "Settings", *, several: bool) -> None:
        """Raise `click.UsageError` where the options do not fit the outputs or the videos."""
        wanted = {sink for sink, _ in options.wanted_outputs()}
        tables = wanted & {"counts", "flows"}
        if tables and not settings.counts:
            raise click.UsageError(f"--{min(tables)} needs lines or zones; give --lines FILE")
        if self.interval and not (tables or "page" in wanted):
            raise click.UsageError("--interval goes with --counts, --flows or --page")
        if self.begin and several and "%" not in self.begin:
            raise click.UsageError(
                "--begin: for several videos give a pattern of their names, as in %Y%m%d_%H%M%S"
            )


def _interval(text: str) -> int:
    match = _INTERVAL.fullmatch(text)
    seconds = int(match[1]) * {"s": 1, "min": 60, "h": 3600}[match[2]] if match else 0
    if not seconds or _DAY % seconds:
        raise click.BadParameter(f"{text!r} is no part of a day; give 30s, 5min, 15min or 1h")
    return seconds


def _begin(text: str) -> str:
    from vdet.traffic.clock import check_begin

    try:
        check_begin(text)
    except ConfigError as error:
        raise click.BadParameter(str(error)) from error
    return text


def counting_options(more: str = "") -> Callable[[F], F]:
    """Add `--counts`, `--flows`, `--interval` and `--begin`: `counting`, a `Counting`.

    `more` ends the help of both outputs.
    """
    counts = options.output_option(
        "--counts FILE",
        "Write which vehicles cross the lines and visit the zones of --lines: .csv has the events, "
        ".totals.csv and .zones.csv have tables by interval, .json has it all. Can be repeated."
        + more,
    )
    flows = options.output_option(
        "--flows FILE",
        "Write how many vehicles go from which line or zone to which: .csv has a row for each "
        "interval, flow and class, .matrix.csv is a matrix, .json has both. Can be repeated."
        + more,
    )
    interval = option(
        "--interval TIME",
        "Interval of tables, and of the bars of a page, as in 5min, 15min or 1h.",
        _interval,
        show_default="the whole video; 1min on a page",
    )
    begin = option(
        "--begin TIME",
        "When the video begins, as in '2026-05-01 07:00+02:00', or the pattern of the time in its "
        "name, as in %Y%m%d_%H%M%S.",
        _begin,
        show_default="its creation time, else the time in its name",
    )
    add_values = options.bundle("counting", Counting, interval, begin)
    return lambda command: counts(flows(add_values(command)))

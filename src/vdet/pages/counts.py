"""The page of `vdet count`: all files of a camera, such as those of a day."""

from collections import Counter
from itertools import product

from vdet.boxes import Image
from vdet.pages.charts import Plot, interval_plot, time_axis
from vdet.pages.render import render
from vdet.pages.traffic import page_table
from vdet.traffic.survey import Survey

_INTERVAL = 900
"""Seconds of an interval of the chart, unless the settings have one."""


def counts_page(survey: Survey, picture: Image | None = None) -> str:
    """Return the page; `picture` is the scene with lines and counts. Errors as for `Survey`."""
    facts = survey.facts()
    return render(
        "counts.html",
        title=facts.title,
        facts=page_table(facts)[1],
        checks=page_table(survey.checks()),
        volumes=page_table(survey.volumes()),
        flows=page_table(survey.flows()),
        files=page_table(survey.files()),
        notes=page_table(survey.notes())[1],
        plot=_plot(survey, survey.settings.traffic.seconds or _INTERVAL),
        picture=picture,
    )


def _plot(survey: Survey, length: int) -> Plot | None:
    """Return the vehicles in each direction by interval; None if some of several have no clock.

    With lines, the events of zones are left out: most of their vehicles cross lines too.
    """
    if len(survey.counts) > 1 and not all(video.clock for video in survey.counts):
        return None
    directions = survey.groups.directions
    zones = {name for video in survey.counts for name in video.zones}
    names = {name for name, _ in directions} - zones or zones
    tally = survey.groups.tally(directions, length)
    periods = tally.intervals.periods
    first, last = periods[0], periods[-1]
    series = {": ".join(key): Counter[float]() for key in directions if key[0] in names}
    for key, period in product(directions, periods):
        if key[0] in names and (count := tally.numbers[period.number, key, None]):
            series[": ".join(key)][period.number] = count
    if not any(series.values()):
        return None
    to_clock = tally.intervals.to_clock
    x = time_axis(first.number, last.number + length, to_clock)
    return interval_plot(series, x, length, "Vehicles by interval", to_clock)

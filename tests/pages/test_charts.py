"""Charts as values; the pages that draw them are tested where they are made."""

from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime
from fractions import Fraction
from zoneinfo import ZoneInfo

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vdet.errors import clock_text
from vdet.pages.render import interval_plot, number_axis, pack_rows, time_axis, time_text
from vdet.traffic.clock import Clock


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0, "0:00"), (7.25, "0:07.2"), (59.96, "1:00"), (75, "1:15"), (3600, "1:00:00"),
     (7384.5, "2:03:04.5"), (-0.5, "−0:00.5"), (-0.01, "0:00")],
)  # fmt: skip
def test_times_have_tenths_where_they_are_not_whole(seconds: float, text: str) -> None:
    assert time_text(seconds) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0, "0:00:00.000"), (59.9996, "0:01:00.000"), (3600 * 12 + 61.5, "12:01:01.500")],
)
def test_times_can_have_hours_and_milliseconds(seconds: float, text: str) -> None:
    assert clock_text(Fraction(seconds), 3, hours=True) == text


def test_axes_have_round_numbers() -> None:
    labels = [text for _, text in time_axis(0, 600).ticks]
    assert labels == ["0:00", "2:00", "4:00", "6:00", "8:00", "10:00"]
    assert time_axis(95, 105).ticks[0] == (96, "1:36")
    assert [text for _, text in number_axis(17).ticks] == ["0", "5", "10", "15", "20"]
    assert [text for _, text in number_axis(1).ticks] == ["0", "1"]


def test_the_series_of_an_interval_are_stacked_and_named_with_their_sums() -> None:
    series = {"in": Counter({60.0: 3, 120.0: 1}), "out": Counter({120.0: 2})}
    plot = interval_plot(series, time_axis(60, 240), 60, "counts")
    assert [(bar.low, bar.high) for bar in plot.bars] == [(0, 3), (0, 1), (1, 3)]
    assert plot.bars[0].color == plot.bars[1].color != plot.bars[2].color
    assert [name for name, _ in plot.legend] == ["in: 4", "out: 2"]


def test_a_time_axis_may_show_the_time_of_the_day() -> None:
    zone = ZoneInfo("Europe/Berlin")
    seven, late, change = (
        Clock(datetime.fromisoformat(text).replace(tzinfo=zone).astimezone(UTC), "", zone).at
        for text in ("2026-05-01 07:00:30", "2026-05-01 23:59:30", "2026-10-25 00:50")
    )
    assert time_axis(0, 120, seven).ticks == [
        (0, "07:00:30"), (30, "07:01"), (60, "07:01:30"), (90, "07:02"), (120, "07:02:30"),
    ]  # fmt: skip
    texts = [text for _, text in time_axis(0, 120, late).ticks]
    assert texts == ["23:59:30", "00:00", "00:00:30", "00:01", "00:01:30"]
    texts = [text for _, text in time_axis(0, 4 * 3600, change).ticks]
    assert texts == ["01:00", "02:00", "02:00", "03:00"]
    texts = [text for _, text in time_axis(0, 10 * 3600, change).ticks]
    assert texts == ["02:00", "02:00", "04:00", "06:00", "08:00"]


@given(
    st.lists(
        st.tuples(st.integers(0, 90), st.integers(0, 30)).map(lambda at: (at[0], sum(at))),
        max_size=25,
    ).map(sorted)
)
@settings(max_examples=50)
def test_no_two_spans_at_one_time_share_a_row_and_no_row_is_needless(
    spans: Sequence[tuple[int, int]],
) -> None:
    rows = pack_rows(spans)
    at_once = [[row for row, (a, b) in zip(rows, spans, strict=True) if a <= time <= b]
               for time in range(121)]  # fmt: skip
    assert all(len(set(item)) == len(item) for item in at_once)
    assert len(set(rows)) == max(map(len, at_once))

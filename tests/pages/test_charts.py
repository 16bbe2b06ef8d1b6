"""Charts as SVG."""

import re
from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pages.html import Elements
from vdet.pages.charts import Series, Span, clock, level_chart, minute_chart, span_chart

NASTY = '"><script>alert(1)</script>'


def number(text: str | None) -> float:
    return float((text or "").removesuffix("%"))


def bars(elements: Elements) -> list[dict[str, str | None]]:
    return elements.all("rect")


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0, "0:00"), (7.25, "0:07.2"), (59.96, "1:00"), (75, "1:15"), (3600, "1:00:00"),
     (7384.5, "2:03:04.5"), (-0.5, "−0:00.5"), (-0.01, "0:00")],
)  # fmt: skip
def test_times_are_written_as_a_clock_shows_them(seconds: float, text: str) -> None:
    assert clock(seconds) == text


class TestLevels:
    def test_bars_are_as_high_as_their_level_and_equal_ones_are_one(self) -> None:
        seen = Elements(level_chart([0, 2, 2, 4], 0, 8, "levels"))
        two, four = bars(seen)
        assert number(four["height"]) == pytest.approx(2 * number(two["height"]))
        assert (number(two["x"]), number(four["x"])) == (25, 75)
        assert number(two["width"]) == pytest.approx(50, abs=0.5)

    def test_the_axes_have_round_numbers(self) -> None:
        html = level_chart([3, 17], 0, 600, "levels")
        assert re.findall(r">([\d:]+)</text>", html) == [
            *("5", "10", "15", "20"),
            *("0:00", "2:00", "4:00", "6:00", "8:00", "10:00"),
        ]

    def test_the_time_begins_where_the_part_begins(self) -> None:
        seen = Elements(level_chart([1], 95, 105, "levels"))
        assert "1:36" in seen.text
        assert "0:00" not in seen.text

    @given(
        levels=st.lists(st.integers(0, 10_000), max_size=20),
        start=st.floats(-1e6, 1e6),
        length=st.floats(0, 1e6),
    )
    @settings(max_examples=30)
    def test_whatever_is_shown_lies_in_the_chart(
        self, levels: Sequence[int], start: float, length: float
    ) -> None:
        seen = Elements(level_chart(levels, start, start + length, "levels"))
        (svg,) = seen.all("svg")
        for bar in bars(seen):
            assert number(bar["y"]) >= 0
            assert number(bar["height"]) > 0
            assert number(bar["y"]) + number(bar["height"]) <= number(svg["height"])
            assert 0 <= number(bar["x"]) < 100
        labels = seen.all("text")
        assert len([label for label in labels if "class" not in label]) <= 7
        assert len(labels) <= 14


class TestMinutes:
    def test_series_are_stacked_and_named_with_their_sums(self) -> None:
        series = [Series("in", {1: 3, 2: 1}), Series("out", {2: 2})]
        seen = Elements(minute_chart(series, range(1, 4), "counts"))
        first, second, third = bars(seen)
        assert number(first["height"]) == pytest.approx(3 * number(second["height"]), abs=0.2)
        top = number(third["y"]) + number(third["height"])
        assert top == pytest.approx(number(second["y"]), abs=0.2)
        assert first["fill"] == second["fill"] != third["fill"]
        assert "in: 4" in seen.text
        assert "out: 2" in seen.text

    def test_without_anything_it_is_empty(self) -> None:
        assert bars(Elements(minute_chart([], range(1), "counts"))) == []


class TestSpans:
    def chart(self, *spans: tuple[float, float]) -> Elements:
        made = [
            Span(number, first, last, f"vehicle {number}", f'href="v.mp4" data-time="{first}"')
            for number, (first, last) in enumerate(spans, start=1)
        ]
        return Elements(span_chart(made, 0, 10, "spans"))

    def places(self, seen: Elements) -> list[tuple[float, float, float]]:
        return [
            (number(each["x"]), number(each["width"]), number(each["y"]))
            for each in seen.all("svg")
            if "x" in each
        ]

    def test_each_vehicle_has_a_bar_that_leads_to_its_moment(self) -> None:
        seen = self.chart((0, 5), (2.5, 10))
        assert [link["data-time"] for link in seen.all("a")] == ["0", "2.5"]
        (x1, width1, y1), (x2, width2, y2) = self.places(seen)
        assert (x1, width1, x2, width2) == (0, 50, 25, 75)
        assert y1 != y2, "they are there at once"

    def test_vehicles_that_follow_one_another_share_a_row(self) -> None:
        rows = {y for _, _, y in self.places(self.chart((0, 2), (3, 5), (6, 10)))}
        assert len(rows) == 1

    def test_an_id_that_does_not_fit_into_its_bar_is_left_out(self) -> None:
        wide = self.chart((0, 9))
        narrow = self.chart((0, 0.7))
        tiny = self.chart((0, 0.1))
        assert [each.get("class") for each in wide.all("text") if "style" in each] == [None]
        assert [each.get("class") for each in narrow.all("text") if "style" in each] == ["roomy"]
        assert [each for each in tiny.all("text") if "style" in each] == []
        assert self.places(tiny)[0][1] > 0, "the bar can be seen"

    @given(
        st.lists(
            st.tuples(st.integers(0, 90), st.integers(0, 30)).map(lambda at: (at[0], sum(at))),
            max_size=25,
        )
    )
    @settings(max_examples=30)
    def test_no_two_vehicles_at_once_share_a_row_and_there_are_no_more_rows_than_needed(
        self, spans: list[tuple[int, int]]
    ) -> None:
        made = [Span(n, first, last, "", "") for n, (first, last) in enumerate(spans)]
        seen = Elements(span_chart(made, 0, 120, "spans"))
        rows = {number(each["y"]) for each in seen.all("svg") if "y" in each}
        at_once = [sum(a <= time <= b for a, b in spans) for time in range(121)]
        assert len(rows) == max(at_once, default=0)


def test_names_are_escaped() -> None:
    html = (
        level_chart([1], 0, 1, NASTY)
        + minute_chart([Series(NASTY, {0: 1})], range(1), NASTY)
        + span_chart([Span(1, 0, 1, NASTY, "")], 0, 1, NASTY)
    )
    assert "<script" not in html
    assert Elements(html).all("script") == []

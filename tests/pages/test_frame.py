import re
from html.parser import HTMLParser

import numpy as np

from vdet.evaluate.report.page import charts
from vdet.pages.frame import Picture, cards, contact_sheet, html_table, page, paragraph, section

NASTY = '<script>alert("&")</script>'
TILE = np.zeros((4, 6, 3), np.uint8)


class _Tags(HTMLParser):
    """Collects the tags, and checks that they close in order."""

    def __init__(self) -> None:
        super().__init__()
        self.seen: list[str] = []
        self.open: list[str] = []

    def handle_starttag(self, tag: str, _: list[tuple[str, str | None]]) -> None:
        self.seen.append(tag)
        if tag not in {"meta", "img"}:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def _nasty_page() -> str:
    parts = (
        paragraph(NASTY),
        cards([(NASTY, NASTY)]),
        html_table([NASTY], [[NASTY]]),
        charts([(NASTY, "<svg/>")]),
        contact_sheet([Picture(TILE, NASTY, NASTY)], tile=100),
    )
    return page(NASTY, NASTY, [section(NASTY, *parts)])


def test_text_is_escaped_everywhere() -> None:
    html = _nasty_page()
    assert "<script" not in html
    assert html.count("&lt;script&gt;") == 13


def test_the_page_is_well_formed() -> None:
    tags = _Tags()
    tags.feed(_nasty_page())
    assert not tags.open
    assert {"section", "table", "figure", "img"} <= set(tags.seen)


def test_nothing_is_fetched_from_elsewhere() -> None:
    sources = re.findall(r'(?:src|href)="([^"]{0,30})', _nasty_page())
    assert [source.partition(";")[0] for source in sources] == [
        "data:image/svg+xml",
        "data:image/jpeg",
    ]


def test_the_best_row_is_marked() -> None:
    html = html_table(["a"], [["first"], ["second"]], best=1)
    assert '<tr class="best"><td>second' in html
    assert html.count("best") == 1

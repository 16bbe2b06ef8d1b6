import re

import numpy as np

from pages.html import Elements
from vdet.evaluate.report.page import charts
from vdet.pages.frame import Picture, cards, contact_sheet, html_table, page, paragraph, section

NASTY = '<script>alert("&")</script>'
TILE = np.zeros((4, 6, 3), np.uint8)


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
    seen = Elements(_nasty_page()).seen
    assert {"section", "table", "figure", "img"} <= {tag for tag, _ in seen}


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

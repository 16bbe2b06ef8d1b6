"""What all pages have in common."""

from pathlib import Path

import numpy as np
import pytest

from pages.html import Elements
from vdet.evaluate.results import Report, Tile
from vdet.files import write_text
from vdet.pages.render import link_to

NASTY = '"><script>alert("&")</script>'


@pytest.fixture(scope="module")
def html() -> str:
    tile = Tile(np.zeros((4, 6, 3), np.uint8), NASTY, NASTY)
    return Report([NASTY, NASTY], {}, [(NASTY, [tile])]).page()


def test_text_is_escaped_everywhere(html: str) -> None:
    seen = Elements(html)
    assert seen.all("script") == []
    assert seen.text.count("<script>") == 5
    assert {"section", "pre", "figure", "img"} <= {tag for tag, _ in seen.seen}


def test_nothing_is_loaded_from_elsewhere(html: str) -> None:
    assert [address.partition(";")[0] for address in Elements(html).addresses()] == [
        "data:image/jpeg"
    ]
    assert "url(" not in html
    assert "@import" not in html


def test_addresses_are_relative_and_quoted() -> None:
    assert link_to(Path("found/a b#?.mp4"), Path("found/a.page")) == "../a%20b%23%3F.mp4"


def test_a_page_can_name_a_file_whose_name_is_no_text(tmp_path: Path) -> None:
    write_text(tmp_path / "page.html", "<p>r\udcff.mp4")
    assert (tmp_path / "page.html").read_text() == "<p>r\\udcff.mp4"

"""The page over many videos: totals, and a link to the page of each."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from vdet.pages.charts import clock
from vdet.pages.render import PAGE_NAME, link_to, render, write_page
from vdet.pages.video import Facts, read_facts


@dataclass(frozen=True, slots=True)
class _Video:
    name: str
    address: str
    facts: Facts

    @property
    def rate(self) -> str:
        """Vehicles a minute."""
        return f"{60 * self.facts.vehicles / self.facts.seconds:.1f}" if self.facts.seconds else "–"


def write_index(outputs: Mapping[str, Path], target: Path) -> None:
    """Write the page over many videos; `outputs` are the folders of their pages by their names.

    A folder without a page is left out.

    Raises
    ------
    OutputError
        A page was not written by this program.
    """
    pages = {name: folder / PAGE_NAME for name, folder in outputs.items()}
    videos = [
        _Video(name, link_to(page, target.parent), read_facts(page))
        for name, page in pages.items()
        if page.is_file()
    ]
    counts: Counter[str] = Counter()
    for video in videos:
        counts.update(video.facts.counts)
    figures = [
        ("vehicles", f"{sum(video.facts.vehicles for video in videos):,}"),
        ("time searched", clock(round(sum(video.facts.seconds for video in videos)))),
        ("frames", f"{sum(video.facts.frames for video in videos):,}"),
        *((name, f"{count:,}") for name, count in counts.items()),
    ]
    html = render("index.html", videos=videos, figures=figures, counts=list(counts))
    write_page(html, target)

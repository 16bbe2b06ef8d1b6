"""The page over many videos: totals, and a link to the page of each."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from vdet.files import escaped
from vdet.pages.charts import clock
from vdet.pages.facts import Facts, read_facts
from vdet.pages.frame import PAGE_NAME, cards, page, paragraph, section
from vdet.pages.player import link_to

_STYLE = """
.videos { display: grid; gap: 14px;
  grid-template-columns: repeat(auto-fill, minmax(min(210px, 100%), 1fr)); }
.videos a { color: inherit; text-decoration: none; display: block; border-radius: 8px;
  border: 1px solid var(--line); overflow: hidden; }
.videos a:hover, .videos a:focus-visible { border-color: var(--mark); }
.videos img { width: 100%; aspect-ratio: 16 / 9; object-fit: cover; display: block;
  background: #111; }
.videos div { padding: 8px 12px 10px; font-size: 13px; color: var(--soft); }
.videos b { display: block; font-size: 15px; color: var(--ink); overflow-wrap: anywhere; }
"""


@dataclass(frozen=True, slots=True)
class _Video:
    name: str
    link: str
    facts: Facts


def write_index(outputs: Mapping[str, Path], target: Path) -> None:
    """Write the page over many videos; `outputs` are the folders of their pages by their names.

    A folder without a page is left out.

    Raises
    ------
    OutputError
        A page is none of this program.
    """
    videos = [
        _Video(
            escaped(name),
            link_to(folder / PAGE_NAME, target.parent),
            read_facts(folder / PAGE_NAME),
        )
        for name, folder in outputs.items()
        if (folder / PAGE_NAME).is_file()
    ]
    target.write_text(index_page(videos), encoding="utf-8")


def index_page(videos: Sequence[_Video]) -> str:
    """Return the page as HTML."""
    facts = [video.facts for video in videos]
    subtitle = f"{len(videos)} {'video' if len(videos) == 1 else 'videos'}"
    return page("Vehicles in videos", subtitle, _sections(videos, facts), style=_STYLE)


def _sections(videos: Sequence[_Video], facts: Sequence[Facts]) -> Iterator[str]:
    counts: Counter[str] = Counter()
    for each in facts:
        counts.update(each.counts)
    yield section(
        "In short",
        cards(
            [
                ("vehicles", str(sum(each.vehicles for each in facts))),
                ("videos", str(len(videos))),
                ("time searched", clock(round(sum(each.seconds for each in facts)))),
                ("frames", f"{sum(each.frames for each in facts):,}"),
                *((name, str(count)) for name, count in counts.items()),
            ]
        ),
        *([] if videos else [paragraph("No video could be searched.")]),
    )
    if videos:
        tiles = "".join(map(_tile, videos))
        yield section("Each video", f'<div class="videos">{tiles}</div>')
        yield section("In numbers", _table(videos, list(counts)))


def _tile(video: _Video) -> str:
    facts = video.facts
    vehicles = "1 vehicle" if facts.vehicles == 1 else f"{facts.vehicles} vehicles"
    return (
        f'<a href="{escape(video.link)}"><img decoding="async" alt="" src="{facts.still}">'
        f"<div><b>{escape(video.name)}</b>"
        f"{vehicles} in {clock(facts.seconds)}</div></a>"
    )


def _table(videos: Sequence[_Video], counts: Sequence[str]) -> str:
    headings = ("video", "length", "frames", "vehicles", "at once", "vehicles a minute", *counts)
    head = "".join(f"<th>{escape(text)}</th>" for text in headings)
    body = "".join(_row(video, counts) for video in videos)
    return f'<div class="wide"><table><tr>{head}</tr>{body}</table></div>'


def _row(video: _Video, counts: Sequence[str]) -> str:
    facts = video.facts
    rate = f"{60 * facts.vehicles / facts.seconds:.1f}" if facts.seconds else "–"
    cells = (
        f'<a href="{escape(video.link)}">{escape(video.name)}</a>',
        clock(facts.seconds),
        f"{facts.frames:,}",
        str(facts.vehicles),
        str(facts.most),
        rate,
        *(str(facts.counts.get(name, 0)) for name in counts),
    )
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"

"""The page over the videos of a batch: totals, a link to each page, and a table of all vehicles."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from vdet.files import write_text
from vdet.pages.render import PAGE_NAME, link_to, render
from vdet.pages.vehicles import Part, VehicleRow, table_json

NO_STILL = "data:image/jpeg;base64,"
"""The still of a video without a frame."""


class VideoFacts(BaseModel):
    """A video in numbers: pages over many videos are made from it.

    `seconds` is how much of the video was searched, `most` how many vehicles were shown at once.
    `counts` are by name, `conditions` say what makes them doubtful; `still` is a small picture as a
    data URI. The player of its page begins at `start`, seconds in the video.
    """

    model_config = ConfigDict(frozen=True)

    start: float = 0.0
    seconds: float = Field(ge=0)
    frames: int = Field(ge=0)
    vehicles: int = Field(ge=0)
    most: int = Field(ge=0)
    still: str = Field(pattern=r"^data:image/jpeg;base64,[A-Za-z0-9+/=]*$")
    counts: dict[str, int] = {}
    conditions: tuple[str, ...] = ()
    rows: tuple[VehicleRow, ...] = ()


def write_index(videos: Sequence[tuple[str, Path, VideoFacts]], target: Path) -> None:
    """Write the page over many videos: each has a name, a page as seen from it, and facts."""
    counts: Counter[str] = Counter()
    for _, _, facts in videos:
        counts.update(facts.counts)
    linked = [(name, link_to(page, Path()), facts) for name, page, facts in videos]
    table = table_json(
        [
            Part(name, page, facts.start, page.removesuffix(PAGE_NAME), facts.rows)
            for name, page, facts in linked
        ]
    )
    write_text(target, render("index.html", videos=linked, counts=counts, table=table))

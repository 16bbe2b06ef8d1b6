"""The page on which counts are checked: strips with marks, all in one file."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any, TextIO
from zlib import crc32

from markupsafe import Markup

from vdet.config.classes import OUR_NAMES
from vdet.config.shapes import TrafficSettings
from vdet.media import VideoInfo
from vdet.pages.render import TEMPLATES, render
from vdet.traffic.counts import Event, class_of
from vdet.traffic.estimate import draw_minutes, strata_of
from vdet.traffic.strips import Band

PAGE_NAME = "review.html"
_PLACE = "<!-- pictures -->"


@dataclass(frozen=True, slots=True)
class StripPicture:
    """A minute of a strip: columns of equal time side by side, the earliest at the left.

    Attributes
    ----------
    band, minute
        Numbers from 0.
    columns, seconds, height
        Number of columns, seconds of each, and rows of each, pixels. Time runs down.
    is_upward
        Whether the page should turn it, so that time runs up.
    """

    band: int
    minute: int
    columns: int
    seconds: int
    height: int
    is_upward: bool


@dataclass(frozen=True, slots=True)
class Mark:
    """A counted crossing: number of the band, seconds from the first frame, place from 0 to 1."""

    band: int
    seconds: float
    place: float
    event: Event


@dataclass(frozen=True, slots=True)
class Review:
    """What the page shows."""

    video: VideoInfo
    traffic: TrafficSettings
    bands: Sequence[Band]
    pictures: Sequence[StripPicture]
    marks: Sequence[Mark]

    def data(self) -> dict[str, Any]:
        """Return the values for the script of the page."""
        video = self.video
        shapes = self.traffic.for_frames(video.width, video.height)
        keep = {"name", "start", "end", "left", "right", "points"}
        lines, zones = (
            [shape.model_dump(mode="json", include=keep) for shape in listed]
            for listed in (shapes.lines, shapes.zones)
        )
        marks = [
            {
                "band": mark.band,
                "seconds": mark.seconds,
                "place": mark.place,
                "line": mark.event.name,
                "time": mark.event.time,
                "direction": mark.event.direction,
                "class": class_of(mark.event),
                "id": mark.event.id,
            }
            for mark in self.marks
        ]
        others = {class_of(mark.event) for mark in self.marks} - set(OUR_NAMES)
        return {
            "video": video.path.name,
            "size": [video.width, video.height],
            "start": float(video.start),
            "made": datetime.now(UTC).isoformat(timespec="seconds"),
            "lines": lines,
            "zones": zones,
            "bands": [{**asdict(band), "samples": band.samples} for band in self.bands],
            "pictures": [asdict(picture) for picture in self.pictures],
            "marks": marks,
            "classes": [*OUR_NAMES, *sorted(others)],
            **self._sampling(),
        }

    def _sampling(self) -> dict[str, Any]:
        """Return what the page needs to draw minutes, and to estimate the true count.

        The seed follows from the name of the video, so nobody can draw until it looks good.
        """
        minutes = sorted({picture.minute for picture in self.pictures})
        counted = {class_of(mark.event): [0] * len(minutes) for mark in self.marks}
        for mark in self.marks:
            counted[class_of(mark.event)][minutes.index(int(mark.seconds // 60))] += 1
        traffic = [sum(numbers) for numbers in zip(*counted.values(), strict=True)]
        traffic = traffic or [0] * len(minutes)
        seed = crc32(self.video.path.name.encode("utf-8", "surrogateescape"))
        order = [minutes[index] for index in draw_minutes(traffic, seed)] if minutes else []
        strata = strata_of(traffic).tolist() if minutes else []
        return {"counted": counted, "strata": strata, "order": order, "seed": seed}


def write_picture(file: TextIO, picture: StripPicture, data: str) -> None:
    """Write the part of the page that holds a picture; `data` is WebP in base 64."""
    name = f"strip-{picture.band}-{picture.minute}"
    file.write(f'<script type="text/plain" id="{name}">{data}</script>\n')


def write_review(file: TextIO, review: Review, pictures: Iterable[str]) -> None:
    """Write the page; `pictures` are the lines of `write_picture`, passed on one by one."""
    names = "review.js", "estimate.js"
    script = Markup("".join((TEMPLATES / name).read_text("utf-8") for name in names))
    page = render("review.html", data=review.data(), script=script, name=review.video.path.name)
    before, _, after = page.partition(_PLACE)
    file.write(before)
    file.writelines(pictures)
    file.write(after)

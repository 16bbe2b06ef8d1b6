"""The page on which counts are checked: strips with marks, all in one file."""

from base64 import b64encode
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TextIO
from zlib import crc32

from markupsafe import Markup

from vdet.config.classes import STANDARD_CLASSES
from vdet.config.shapes import TrafficSettings
from vdet.findings import Finding
from vdet.media import VideoInfo
from vdet.pages.render import TEMPLATES, render
from vdet.traffic.counts import Event, Trace, class_of
from vdet.traffic.sample import draw_minutes, strata_of
from vdet.traffic.strips import Band

PAGE_NAME = "review.html"
_PICTURES = "<!-- pictures -->"
_SCRIPTS = "yaml.js", "estimate.js", "review.js"


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

    @property
    def name(self) -> str:
        """Name of the picture in the page."""
        return f"strip-{self.band}-{self.minute}"


def crop_name(track: int) -> str:
    """Return the name in the page of the best picture of a vehicle."""
    return f"crop-{track}"


@dataclass(frozen=True, slots=True)
class EventMark:
    """A counted event: number of the band, seconds from the first frame, position from 0 to 1.

    What appears or vanishes inside a zone is in no band.
    """

    band: int | None
    seconds: float
    position: float
    event: Event

    @property
    def minute(self) -> int:
        """Number from 0."""
        return int(self.seconds // 60)


@dataclass(frozen=True, slots=True)
class Review:
    """What the page shows."""

    video: VideoInfo
    traffic: TrafficSettings
    bands: Sequence[Band]
    pictures: Sequence[StripPicture]
    marks: Sequence[EventMark]
    traces: Sequence[Trace]
    findings: Sequence[Finding] = ()
    written: str = field(default_factory=lambda: datetime.now(UTC).isoformat(timespec="seconds"))

    @property
    def key(self) -> str:
        """The key of what was checked in the storage of the browser."""
        return f"vdet review {self.video.name} {self.written}"

    def data(self) -> dict[str, Any]:
        """Return the values for the script of the page."""
        video = self.video
        shapes = self.traffic.for_frames(video.width, video.height)
        fields = {"name", "start", "end", "left", "right", "points"}
        lines, zones = (
            [shape.model_dump(mode="json", include=fields) for shape in listed]
            for listed in (shapes.lines, shapes.zones)
        )
        marks = [
            {
                "band": mark.band,
                "seconds": mark.seconds,
                "position": mark.position,
                "line": mark.event.name,
                "direction": mark.event.direction,
                "class": class_of(mark.event),
                "id": mark.event.id,
            }
            for mark in self.marks
        ]
        unlisted = {class_of(mark.event) for mark in self.marks} - set(STANDARD_CLASSES)
        return {
            "video": video.name,
            "size": [video.width, video.height],
            "key": self.key,
            "lines": lines,
            "zones": zones,
            "bands": [{**asdict(band), "samples": band.samples} for band in self.bands],
            "pictures": [asdict(picture) for picture in self.pictures],
            "marks": marks,
            "traces": [asdict(trace) for trace in self.traces],
            "classes": [*STANDARD_CLASSES, *sorted(unlisted)],
            **self._sampling(),
        }

    def _sampling(self) -> dict[str, Any]:
        """Return what the page needs to draw minutes, and to estimate the true count.

        The seed follows from the name of the video, so nobody can draw until it looks good.
        """
        minutes = sorted(
            {picture.minute for picture in self.pictures} | {mark.minute for mark in self.marks}
        )
        marks = Counter((class_of(mark.event), mark.minute) for mark in self.marks)
        traffic = Counter(mark.minute for mark in self.marks)
        numbers = [traffic[minute] for minute in minutes]
        seed = crc32(self.video.name.encode())
        return {
            "minutes": minutes,
            "counted": {
                name: [marks[name, minute] for minute in minutes]
                for name in dict.fromkeys(name for name, _ in marks)
            },
            "strata": strata_of(numbers).tolist(),
            "order": [minutes[index] for index in draw_minutes(numbers, seed)],
            "seed": seed,
        }


def write_review(file: TextIO, review: Review, folder: Path) -> None:
    """Write the page. `folder` has its pictures, WebP files; a vehicle may have none."""
    scripts = [Markup((TEMPLATES / name).read_text("utf-8")) for name in _SCRIPTS]
    name, findings = review.video.name, review.findings
    page = render("review.html", data=review.data(), scripts=scripts, name=name, findings=findings)
    before, _, after = page.partition(_PICTURES)
    file.write(before)
    crops = {crop_name(mark.event.id) for mark in review.marks}
    for path in (folder / name for name in (*(p.name for p in review.pictures), *sorted(crops))):
        if path.exists():
            data = b64encode(path.read_bytes()).decode("ascii")
            file.write(f'<script type="text/plain" id="{path.name}">{data}</script>\n')
    file.write(after)

"""The page on which counts are checked: strips with marks, all in one file."""

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass
from pathlib import Path
from typing import Any, TextIO
from zlib import crc32

from markupsafe import Markup

from vdet.config.classes import STANDARD_CLASSES
from vdet.config.scene import TrafficSettings
from vdet.files import valid_text
from vdet.findings import Finding
from vdet.media import VideoInfo
from vdet.pages.render import TEMPLATES, render
from vdet.traffic.correcting import covers
from vdet.traffic.corrections import MAX_BYTES, Corrections
from vdet.traffic.counts import Corrected, Counts, Event, Trace, class_of
from vdet.traffic.sample import EqualSpans, draw_spans, span_length, strata_of
from vdet.traffic.strips import Band
from vdet.version import __version__

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


@dataclass(frozen=True, slots=True)
class Review:
    """What the page shows.

    Attributes
    ----------
    counted
        The counts before corrections, with a mark for each event.
    opened
        The counts with the corrections that the page opens, of the file `reviewed`; None: none.
    added
        The marks of the events that these add.
    """

    video: VideoInfo
    traffic: TrafficSettings
    bands: Sequence[Band]
    pictures: Sequence[StripPicture]
    marks: Sequence[EventMark]
    traces: Sequence[Trace]
    counted: Counts
    findings: Sequence[Finding] = ()
    opened: Corrected | None = None
    reviewed: Corrections | None = None
    added: Sequence[EventMark] = ()

    @property
    def key(self) -> str:
        """The key of what was checked in the storage of the browser: of the path and the tracks."""
        seen = [astuple(mark) for mark in (*self.marks, *self.added)], self.reviewed
        return (
            f"vdet review {valid_text(str(self.video.path.resolve()))} {crc32(repr(seen).encode())}"
        )

    def data(self) -> dict[str, Any]:
        """Return the values for the script of the page."""
        video, spans = self.video, self._spans()
        marks = [{**_values(mark), "id": mark.event.id} for mark in self.marks]
        unlisted = {class_of(mark.event) for mark in (*self.marks, *self.added)} - set(
            STANDARD_CLASSES
        )
        traffic = [0] * len(spans)
        for mark in self.marks:
            if mark.band is not None:
                traffic[spans.index(mark.event.time)] += 1
        seed = crc32(video.path.name.encode("utf-8", "surrogateescape"))
        return {
            "head": self._head(),
            "limit": MAX_BYTES,
            "key": self.key,
            "zones": [zone.name for zone in self.traffic.zones],
            "bands": [{**asdict(band), "samples": band.samples} for band in self.bands],
            "pictures": [asdict(picture) for picture in self.pictures],
            "marks": marks,
            "traces": [asdict(trace) for trace in self.traces],
            "classes": [*STANDARD_CLASSES, *sorted(unlisted)],
            "spans": [
                {"number": number, "start": start, "end": end}
                for number, (start, end) in zip(
                    spans.numbers, map(spans.bounds, range(len(spans))), strict=True
                )
            ],
            "strata": strata_of(traffic).tolist(),
            # The seed follows from the name, so nobody can draw until it looks good.
            "order": [spans.numbers[index] for index in draw_spans(traffic, seed)],
            "seed": seed,
            "opened": self._state(spans),
        }

    def _spans(self) -> EqualSpans:
        head = self._head()
        return EqualSpans(head["start"], head["end"], head["span"], self.counted.spans)

    def _head(self) -> dict[str, Any]:
        """Return what a file of corrections says of its video and of the lines."""
        shapes = self.traffic.for_frames(self.video.width, self.video.height)
        fields = {"name", "start", "end", "left", "right", "points"}
        source = self.counted.source
        start = round(self.counted.spans[0][0], 3)
        end = round(self.counted.spans[-1][1] + float(1 / self.video.rate), 3)
        return {
            "video": source.name if source else self.video.name,
            "size": [self.video.width, self.video.height],
            "length": source and source.length,
            "begin": source and source.begin and source.begin.isoformat(),
            "program": f"vdet {__version__}",
            "start": start,
            "end": end,
            "span": span_length(end - start),
            "lines": [line.model_dump(mode="json", include=fields) for line in shapes.lines],
            "zones": [zone.model_dump(mode="json", include=fields) for zone in shapes.zones],
        }

    def _state(self, spans: EqualSpans) -> dict[str, Any] | None:
        """Return what a reviewer changed, as the script has it."""
        if not (self.opened and self.reviewed):
            return None
        keys = {mark.event: f"c{number}" for number, mark in enumerate(self.marks)}
        fixes, times = dict[str, dict[str, str | None]](), dict[str, float]()
        for item in self.opened.corrections:
            if item.counted and (right := item.right):
                ways, names = (
                    (item.counted.direction, right.direction),
                    (class_of(item.counted), class_of(right)),
                )
                wrong = {"class": names, "direction": ways}
                fixes[keys[item.counted]] = {
                    k: after for k, (before, after) in wrong.items() if before != after
                }
                times[keys[item.counted]] = round(right.time, 3)
            elif item.counted:
                fixes[keys[item.counted]] = {"false": None}
        return {
            "fixes": fixes,
            "times": times,
            "missed": [_values(mark) for mark in self.added],
            "checked": [
                number
                for index, number in enumerate(spans.numbers)
                if covers(self.opened.checked, spans.bounds(index))
            ],
            "reviewer": self.reviewed.reviewer or "",
            "sample": self.reviewed.sample and self.reviewed.sample.model_dump(),
        }


def _values(mark: EventMark) -> dict[str, Any]:
    """Return a mark for the script of the page."""
    event = mark.event
    place = {"band": mark.band, "seconds": mark.seconds, "position": mark.position}
    names = {"line": event.name, "direction": event.direction, "class": class_of(event)}
    return place | names | {"vehicle": event.vehicle}


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

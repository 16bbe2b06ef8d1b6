"""The page on which counts are checked: strips with marks, all in one file."""

import tempfile
from base64 import b64encode
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict, astuple, dataclass, field
from math import inf
from pathlib import Path
from typing import Any, Self, TextIO
from zlib import crc32

import cv2
import numpy as np
from markupsafe import Markup

from vdet.boxes import Image
from vdet.config.classes import STANDARD_CLASSES
from vdet.config.scene import TrafficSettings
from vdet.config.schema import Settings
from vdet.files import valid_text
from vdet.findings import Finding
from vdet.media import Picture, VideoInfo
from vdet.media.frame import Coding
from vdet.media.images import coarse_scale, shrunk
from vdet.pages.render import TEMPLATES, render
from vdet.review.correcting import correct, covers
from vdet.review.corrections import MAX_BYTES, Corrections
from vdet.review.estimate import draw_spans, equal_spans, span_length, strata_of
from vdet.review.strips import Band, BandPassage, Passages, Sampling, bands_of, sampling_of
from vdet.review.traces import TraceSearch
from vdet.track.track import FrameTracks
from vdet.traffic.clock import Span
from vdet.traffic.counts import Corrected, Counts, Event, Trace, class_of
from vdet.traffic.crossings import Border
from vdet.traffic.records import BestCrops, Crop
from vdet.version import __version__

_PICTURES = "<!-- pictures -->"
_SCRIPTS = "yaml.js", "estimate.js", "review.js"
_MINUTE = 60
_ENOUGH = 6
"""Number of passages after which the sampling of a band is final."""
_COLUMN_ROWS = 800
"""Approximate height of the columns that a strip is cut into, pixels."""
_CROP_SIDE = 120
"""Maximum side of the picture of a vehicle, pixels."""
_QUALITY = 60
_SAME = 1.0
"""Maximum seconds between a counted crossing and the passage that gives its position."""


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
    """A counted event: number of the band, position from 0 to 1.

    What appears or vanishes inside a zone is in no band.
    """

    band: int | None
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
        path = valid_text(str(self.video.path.resolve()))
        return f"vdet review {path} {crc32(repr(seen).encode())}"

    def data(self) -> dict[str, Any]:
        """Return the values for the script of the page."""
        video, head = self.video, self._head()
        spans = equal_spans(head["start"], head["end"], head["span"], self.counted.spans)
        numbers, starts = list(spans), [start for start, _ in spans.values()]
        unlisted = {class_of(mark.event) for mark in (*self.marks, *self.added)}
        unlisted -= {*STANDARD_CLASSES}
        times = [mark.event.time for mark in self.marks if mark.band is not None]
        traffic = np.histogram(times, [-inf, *starts[1:], inf])[0]
        seed = crc32(video.path.name.encode("utf-8", "surrogateescape"))
        return {
            "head": head,
            "limit": MAX_BYTES,
            "key": self.key,
            "zones": [zone.name for zone in self.traffic.zones],
            "bands": [{**asdict(band), "samples": band.samples} for band in self.bands],
            "pictures": [asdict(picture) for picture in self.pictures],
            "marks": [{**_values(mark), "id": mark.event.id} for mark in self.marks],
            "traces": [asdict(trace) for trace in self.traces],
            "classes": [*STANDARD_CLASSES, *sorted(unlisted)],
            "spans": [{"number": n, "start": a, "end": b} for n, (a, b) in spans.items()],
            "strata": strata_of(traffic).tolist(),
            # The seed follows from the name, so nobody can draw until it looks good.
            "order": [numbers[index] for index in draw_spans(traffic, seed)],
            "seed": seed,
            "opened": self._state(spans),
        }

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

    def _state(self, spans: Mapping[int, Span]) -> dict[str, Any] | None:
        """Return what a reviewer changed, as the script has it."""
        if not (self.opened and self.reviewed):
            return None
        keys = {mark.event: f"c{number}" for number, mark in enumerate(self.marks)}
        corrected = [(keys[c.counted], c) for c in self.opened.corrections if c.counted]
        return {
            "fixes": {key: item.errors for key, item in corrected},
            "times": {key: round(item.right.time, 3) for key, item in corrected if item.right},
            "missed": [_values(mark) for mark in self.added],
            "checked": [n for n, span in spans.items() if covers(self.opened.checked, span)],
            "reviewer": self.reviewed.reviewer or "",
            "sample": self.reviewed.sample and self.reviewed.sample.model_dump(),
        }


def _values(mark: EventMark) -> dict[str, Any]:
    """Return a mark for the script of the page."""
    event = mark.event
    place = {"band": mark.band, "seconds": round(event.time, 3), "position": mark.position}
    names = {"line": event.name, "direction": event.direction, "class": class_of(event)}
    return place | names | {"vehicle": event.vehicle}


def write_review(file: TextIO, review: Review, folder: Path, index: str) -> None:
    """Write the page. `folder` has its pictures, WebP files; a vehicle may have none.

    `index` is the address of the list of all reviews of a batch; empty without one.
    """
    scripts = [Markup((TEMPLATES / name).read_text("utf-8")) for name in _SCRIPTS]
    values = {"review": review, "data": review.data(), "index": index}
    page = render("review.html", scripts=scripts, **values)
    before, _, after = page.partition(_PICTURES)
    file.write(before)
    crops = {crop_name(mark.event.id) for mark in review.marks}
    for path in (folder / name for name in (*(p.name for p in review.pictures), *sorted(crops))):
        if path.exists():
            data = b64encode(path.read_bytes()).decode("ascii")
            file.write(f'<script type="text/plain" id="{path.name}">{data}</script>\n')
    file.write(after)


@dataclass(slots=True)
class _Strip:
    """The strip of a band in the current minute, whose frames have their seconds in it.

    The frames before the first passages have a single row, and are stretched.
    """

    band: Band
    search: TraceSearch
    sampling: Sampling
    rows: list[tuple[float, Image]] = field(default_factory=list)
    passed: int = 0

    def add(self, seconds: float, picture: Picture, passages: list[BandPassage]) -> None:
        """Add a frame."""
        if len(passages) >= _ENOUGH:
            self.improve(passages)
        self.rows.append((seconds, self.sampling.cut(picture.layers)))

    def improve(self, passages: list[BandPassage]) -> None:
        """Choose the sampling by the passages so far, unless it was chosen by enough of them."""
        if self.passed < _ENOUGH:
            self.sampling, self.passed = sampling_of(self.band, passages), len(passages)


class ReviewRecorder:
    """Records the strips of a video while it is read, minute by minute, and the best pictures.

    A context manager: its pictures are temporary files until `write`.
    """

    def __init__(
        self, video: VideoInfo, settings: Settings, borders: Sequence[Border], crops: BestCrops
    ) -> None:
        self._video, self._settings, self._crops = video, settings, crops
        bands = bands_of(borders)
        self._strips = [
            _Strip(band, TraceSearch(number, band), sampling_of(band, ()))
            for number, band in enumerate(bands)
        ]
        self._tracks: list[FrameTracks] = []
        self._traces: list[Trace] = []
        self._passages = Passages(bands)
        self._folder = tempfile.TemporaryDirectory()
        self._pictures: list[StripPicture] = []
        self._minute = 0
        self._coding: Coding | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._folder.cleanup()

    def add(self, frame: FrameTracks, selected: FrameTracks, picture: Picture) -> None:
        """Add a frame, with its tracks, and those of the selected classes."""
        if (minute := int(frame.time // _MINUTE)) != self._minute:
            self._end_minute(is_end=False)
            self._minute = minute
        self._coding = picture.planes.coding if picture.planes else None
        self._tracks.append(frame)
        self._passages.add(frame)
        for strip, passages in zip(self._strips, self._passages.by_band, strict=True):
            strip.add(frame.time - _MINUTE * minute, picture, passages)
        self._write_crops(self._crops.add(selected, picture))

    def end(self) -> tuple[Trace, ...]:
        """End the strips after the last frame, and return what passed without a track."""
        self._end_minute(is_end=True)
        self._write_crops(self._crops.end())
        return tuple(sorted(self._traces, key=lambda trace: trace.time))

    def write(
        self,
        path: Path,
        counted: Counts,
        counts: Counts,
        corrections: Corrections | None,
        index: str,
    ) -> dict[str, Any]:
        """Write the page, and return what `reviews.html` says of it.

        `counted` are the counts before `corrections`, which the page opens; `index` as for
        `write_review`.
        """
        opened = None
        if corrections:
            settings = self._settings.model_copy(update={"classes": ()})
            opened = correct({"": counted}, {"": corrections}, settings)[""].corrected
        every = opened.corrections if opened else ()
        review = Review(
            video=self._video,
            traffic=self._settings.traffic,
            bands=[strip.band for strip in self._strips],
            pictures=self._pictures,
            marks=self._marks(counted.events),
            traces=counts.traces,
            findings=counts.findings,
            counted=counted,
            opened=opened,
            reviewed=corrections,
            added=self._marks([item.right for item in every if item.right and not item.counted]),
        )
        with path.open("w", encoding="utf-8", errors="backslashreplace") as file:
            write_review(file, review, Path(self._folder.name), index)
        return {
            "key": review.key,
            "vehicles": len({event.vehicle for event in counted.events}),
            "minutes": len({picture.minute for picture in self._pictures}),
        }

    def _end_minute(self, *, is_end: bool) -> None:
        for number, (strip, passages) in enumerate(
            zip(self._strips, self._passages.by_band, strict=True)
        ):
            if strip.rows:
                strip.improve(passages)
                self._write_minute(number, strip)
                rows = [rows for _, rows in strip.rows]
                self._traces += strip.search.search(self._tracks, rows, passages, is_end=is_end)
            strip.rows = []
        self._tracks = []

    def _write_minute(self, number: int, strip: _Strip) -> None:
        sampling = strip.sampling
        rate = sampling.rows * float(self._video.rate)  # rows a second
        last = strip.rows[-1][0]
        seconds = min(max(1, round(_COLUMN_ROWS / rate)), int(last) + 1)
        columns, height = int(last // seconds) + 1, int(np.ceil(seconds * rate))
        image = np.full((height, columns, strip.band.samples, 3), 128, np.uint8)
        for time, rows in strip.rows:
            column, top = int(time // seconds), round(time % seconds * rate)
            stretched = rows[np.arange(sampling.rows) * len(rows) // sampling.rows]
            part = stretched[: height - top]
            image[top : top + len(part), column] = part
        flat = image.reshape(height, -1, 3)
        if self._coding:
            luma, blue, red = (np.ascontiguousarray(layer) for layer in np.moveaxis(flat, 2, 0))
            flat = self._coding.to_bgr((luma, blue, red))
        picture = StripPicture(number, self._minute, columns, seconds, height, sampling.is_upward)
        self._pictures.append(picture)
        self._write(picture.name, self._shown(flat, number))

    def _shown(self, strip: Image, number: int) -> Image:
        """Return the picture of a strip in the detail that `output.coarse` allows."""
        if not self._settings.output.coarse:
            return strip
        band, passages = self._strips[number].band, self._passages.by_band[number]
        widest = max((passage.width for passage in passages), default=0.0)
        scale = coarse_scale(widest / band.length * band.samples, band.samples)
        return shrunk(strip, round(scale * band.samples) / band.samples)  # whole pixels a column

    def _write_crops(self, crops: Sequence[Crop]) -> None:
        for crop in crops:
            scale = _CROP_SIDE / max(crop.image.shape)
            self._write(crop_name(crop.id), shrunk(crop.image, scale))

    def _write(self, name: str, image: Image) -> None:
        _, data = cv2.imencode(".webp", image, [cv2.IMWRITE_WEBP_QUALITY, _QUALITY])
        (Path(self._folder.name) / name).write_bytes(data.tobytes())

    def _marks(self, events: Sequence[Event]) -> list[EventMark]:
        """Return where the counted events are."""
        passed = defaultdict[tuple[int, int], list[BandPassage]](list)
        for number, passages in enumerate(self._passages.by_band):
            for passage in passages:
                passed[number, passage.id].append(passage)
        marks = []
        for event in events:
            bands = [
                number
                for number, strip in enumerate(self._strips)
                if strip.band.name == event.name and event.direction in strip.band.directions
            ]
            near = ((band, passage) for band in bands for passage in passed[band, event.id])
            spots = [(abs(p.time - event.time), band, p.position) for band, p in near]
            spots += [(_SAME, band, 0.5) for band in bands]  # if there is no passage
            _, band, position = min(spots, default=(0.0, None, 0.5))
            marks.append(EventMark(band, round(position, 3), event))
        return marks

"""The page on which counts are checked: strips with marks, all in one file."""

from base64 import b64encode
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict, astuple, dataclass, field
from functools import cached_property
from math import inf
from pathlib import Path
from typing import Any, Literal, TextIO
from zlib import crc32

import cv2
import numpy as np
from markupsafe import Markup

from vdet import draw
from vdet.boxes import Box, Image
from vdet.config.classes import STANDARD_CLASSES
from vdet.config.schema import Settings
from vdet.files import valid_text
from vdet.media import Picture, VideoInfo
from vdet.media.frame import Coding
from vdet.media.images import coarse_scale, shrunk
from vdet.pages.render import TEMPLATES, render
from vdet.pages.traffic import scene_picture
from vdet.review.corrections import MAX_BYTES, Corrections, correct, covers
from vdet.review.estimate import draw_spans, equal_spans, span_length, strata_of
from vdet.review.strips import (
    DELAY,
    Band,
    BandPassage,
    Passages,
    Sampling,
    TraceSearch,
    bands_of,
    sampling_of,
)
from vdet.track.track import FrameTracks
from vdet.traffic.clock import Span
from vdet.traffic.counts import Corrected, Counts, Event, Trace, class_of
from vdet.traffic.crossings import Border
from vdet.version import __version__

_PICTURES = "<!-- pictures -->"
_SCRIPTS = "yaml.js", "estimate.js", "review.js"
_MINUTE = 60
_ENOUGH = 6
"""Number of passages after which the sampling of a band is final."""
_COLUMN_ROWS = 800
"""Approximate height of the columns that a strip is cut into, pixels."""
_REPEATED = 0.5
"""Seconds of a column that the next one repeats."""
_SCENE_WIDTH, _MOMENT_WIDTH = 480, 320
"""Widths of the picture of the scene and of the frames of doubtful marks, pixels."""
_UNSURE = 0.6
"""Score of a track below which its mark is doubtful."""
_BESIDE = 2.0
"""Seconds from a trace within which marks at the line are doubtful."""
_MOMENTS = 200
"""Maximum number of frames of doubtful marks in an hour."""
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
    columns, seconds, rows
        Number of columns, seconds of each, and rows of each, pixels. Time runs down.
    way
        Where time runs in the page so that vehicles stand upright: "up", if the page should turn
        it, "down", or "right": its columns lie on their sides below one another, the top of the
        frame at the top.
    lead
        Seconds at the start of a column which repeat the end of the one before.
    """

    band: int
    minute: int
    columns: int
    seconds: int
    rows: int
    way: Literal["up", "down", "right"]
    lead: float

    @property
    def name(self) -> str:
        """Name of the picture in the page."""
        return f"strip-{self.band}-{self.minute}"


def crop_name(track: int) -> str:
    """Return the name in the page of the best picture of a vehicle."""
    return f"crop-{track}"


def _moment_name(band: int, passage: BandPassage) -> str:
    """Return the name in the page of the frame in which a vehicle passes a band."""
    return f"moment-{band}-{passage.id}-{passage.time:.3f}"


def _is_beside(band: int | None, seconds: float, traces: Sequence[Trace]) -> bool:
    """Return whether there is a trace at a band at about this time."""
    return any(item.band == band and abs(item.time - seconds) < _BESIDE for item in traces)


@dataclass(frozen=True, slots=True)
class EventMark:
    """A counted event: number of the band, position from 0 to 1, name of the picture of its frame.

    What appears or vanishes inside a zone is in no band, and has no picture.
    """

    band: int | None
    position: float
    event: Event
    moment: str = ""


@dataclass(frozen=True)
class Review:
    """What the page shows.

    Attributes
    ----------
    counted, counts
        The counts before corrections, with a mark for each event, and at the end, with traces.
    reviewed
        The corrections that the page opens; None: none.
    """

    video: VideoInfo
    settings: Settings
    passages: Passages
    pictures: Sequence[StripPicture]
    counted: Counts
    counts: Counts
    reviewed: Corrections | None

    @cached_property
    def opened(self) -> Corrected | None:
        """The counts of all classes with the corrections; None without any."""
        if not self.reviewed:
            return None
        settings = self.settings.model_copy(update={"classes": ()})
        return correct({"": self.counted}, {"": self.reviewed}, settings)[""].corrected

    @cached_property
    def marks(self) -> list[EventMark]:
        """Where the counted events are."""
        return self._marks(self.counted.events)

    @cached_property
    def added(self) -> list[EventMark]:
        """The marks of the events that the corrections add."""
        every = self.opened.corrections if self.opened else ()
        return self._marks([item.right for item in every if item.right and not item.counted])

    @property
    def moments(self) -> list[str]:
        """The names of the frames of doubtful marks: unsure, beside a trace, or corrected."""
        corrected = {item.counted for item in self.opened.corrections} if self.opened else set()

        def score(mark: EventMark) -> float:
            return 1.0 if mark.event.score is None else mark.event.score

        def is_doubtful(mark: EventMark) -> bool:
            is_beside = _is_beside(mark.band, mark.event.time, self.counts.traces)
            return is_beside or score(mark) < _UNSURE or mark.event in corrected

        hours = 1 + int(self.counted.spans[-1][1] // 3600)
        doubtful = sorted(filter(is_doubtful, self.marks), key=score)
        return [mark.moment for mark in doubtful if mark.moment][: _MOMENTS * hours]

    @property
    def key(self) -> str:
        """The key of what was checked in the storage of the browser: of the path and the tracks."""
        seen = [astuple(mark) for mark in (*self.marks, *self.added)], self.reviewed
        path = valid_text(str(self.video.path.resolve()))
        return f"vdet review {path} {crc32(repr(seen).encode())}"

    def write(self, file: TextIO, folder: Path, index: str) -> None:
        """Write the page. `folder` has its pictures, WebP files; a vehicle may have none.

        `index` is the address of the list of all reviews of a batch; empty without one.
        """
        scripts = [Markup((TEMPLATES / name).read_text("utf-8")) for name in _SCRIPTS]
        values = {"review": self, "data": self.data(), "index": index}
        before, _, after = render("review.html", scripts=scripts, **values).partition(_PICTURES)
        file.write(before)
        crops = sorted({crop_name(mark.event.id) for mark in self.marks})
        names = "scene-picture", *(item.name for item in self.pictures), *crops, *self.moments
        for path in (folder / name for name in names):
            if path.exists():
                data = b64encode(path.read_bytes()).decode("ascii")
                file.write(f'<script type="text/plain" id="{path.name}">{data}</script>\n')
        file.write(after)

    def data(self) -> dict[str, Any]:
        """Return the values for the script of the page."""
        video, head = self.video, self._head()
        clock = self.counted.clock and self.counted.clock.at(0.0)
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
            "clock": clock and 3600 * clock.hour + 60 * clock.minute + clock.second,
            "zones": [zone.name for zone in self.settings.traffic.zones],
            "bands": [{**asdict(band), "samples": band.samples} for band in self.passages.bands],
            "pictures": [asdict(picture) for picture in self.pictures],
            "marks": [{**_values(mark), "id": mark.event.id} for mark in self.marks],
            "traces": [asdict(trace) for trace in self.counts.traces],
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
        shapes = self.settings.traffic.for_frames(self.video.width, self.video.height)
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

    def _marks(self, events: Sequence[Event]) -> list[EventMark]:
        """Return where events are."""
        passed = defaultdict[tuple[int, int], list[BandPassage]](list)
        for number, passages in enumerate(self.passages.by_band):
            for passage in passages:
                passed[number, passage.id].append(passage)
        marks = []
        for event in events:
            bands = [
                number
                for number, band in enumerate(self.passages.bands)
                if band.name == event.name and event.direction in band.directions
            ]
            near = ((band, passage) for band in bands for passage in passed[band, event.id])
            spots = [
                (abs(p.time - event.time), band, p.position, _moment_name(band, p))
                for band, p in near
            ]
            spots += [(_SAME, band, 0.5, "") for band in bands]  # if there is no passage
            _, band, position, moment = min(spots, default=(0.0, None, 0.5, ""))
            marks.append(EventMark(band, round(position, 3), event, moment))
        return marks


def _values(mark: EventMark) -> dict[str, Any]:
    """Return a mark for the script of the page."""
    event = mark.event
    place = {"band": mark.band, "seconds": round(event.time, 3), "position": mark.position}
    names = {"line": event.name, "direction": event.direction, "class": class_of(event)}
    return place | names | {"vehicle": event.vehicle, "moment": mark.moment}


@dataclass(slots=True)
class _Strip:
    """The strip of a band in the current minute, whose frames have their times.

    `before` has those at the end of the minute before. The frames before the first passages have a
    single row, and are stretched.
    """

    band: Band
    search: TraceSearch
    sampling: Sampling
    rows: list[tuple[float, Image]] = field(default_factory=list)
    before: list[tuple[float, Image]] = field(default_factory=list)
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
    """Records the strips of a video while it is read, minute by minute.

    Until `write`, all pictures are files in `folder`, also those of vehicles (`crop_name`). The
    page opens `corrections`.
    """

    def __init__(
        self,
        folder: Path,
        video: VideoInfo,
        settings: Settings,
        borders: Sequence[Border],
        corrections: Corrections | None,
    ) -> None:
        self._video, self._settings = video, settings
        self._corrections = corrections
        bands = bands_of(borders)
        self._strips = [
            _Strip(band, TraceSearch(number, band), sampling_of(band, ()))
            for number, band in enumerate(bands)
        ]
        self._tracks: list[FrameTracks] = []
        self._traces: list[Trace] = []
        self._passages = Passages(bands)
        self._folder = folder
        self._pictures: list[StripPicture] = []
        self._undecided: list[tuple[int, BandPassage, Image]] = []  # with the number of the band
        self._minute = 0
        self._coding = Coding(full_range=True)  # of strips of images

    def add(self, frame: FrameTracks, picture: Picture) -> None:
        """Add a frame with its tracks of all classes."""
        if not (self._tracks or self._pictures):  # the first frame
            small = self._reduced(picture.image, _SCENE_WIDTH, largest=0)
            self._write("scene-picture", scene_picture(small, self._settings.traffic, ()))
        if (minute := int(frame.time // _MINUTE)) != self._minute:
            self._end_minute(is_end=False)
            self._minute = minute
        if picture.planes:
            self._coding = picture.planes.coding
        self._tracks.append(frame)
        passed = list(map(len, self._passages.by_band))
        self._passages.add(frame)
        for number, passages in enumerate(self._passages.by_band):
            self._strips[number].add(frame.time, picture, passages)
            for passage in passages[passed[number] :]:
                self._add_moment(number, passage, picture.image)

    def end(self) -> tuple[Trace, ...]:
        """End the strips after the last frame, and return what passed without a track."""
        self._end_minute(is_end=True)
        return tuple(sorted(self._traces, key=lambda trace: trace.time))

    def write(self, path: Path, counted: Counts, counts: Counts, index: str) -> dict[str, Any]:
        """Write the page, and return what `reviews.html` says of it.

        `counted` are the counts before corrections; `index` as for `Review.write`.
        """
        review = Review(
            video=self._video,
            settings=self._settings,
            passages=self._passages,
            pictures=self._pictures,
            counted=counted,
            counts=counts,
            reviewed=self._corrections,
        )
        with path.open("w", encoding="utf-8", errors="backslashreplace") as file:
            review.write(file, self._folder, index)
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
            strip.before = [item for item in strip.rows if item[0] >= strip.rows[-1][0] - 1]
            strip.rows = []
        self._write_beside(is_end=is_end)
        self._tracks = []

    def _write_minute(self, number: int, strip: _Strip) -> None:
        sampling = strip.sampling
        rate = sampling.rows * float(self._video.rate)  # rows a second
        lead = float(round(_REPEATED * self._video.rate) / self._video.rate)  # whole frames
        begin = _MINUTE * self._minute
        last = strip.rows[-1][0] - begin
        seconds = min(max(1, round(_COLUMN_ROWS / rate)), int(last) + 1)
        columns, height = int(last // seconds) + 1, int(np.ceil((seconds + lead) * rate))
        image = np.full((height, columns, strip.band.samples, 3), 128, np.uint8)
        for time, rows in (*strip.before, *strip.rows):
            stretched = rows[np.arange(sampling.rows) * len(rows) // sampling.rows]
            ends = time - begin, time - begin + lead
            for column in {int(end // seconds) for end in ends} & {*range(columns)}:
                top = round((ends[1] - column * seconds) * rate)
                part = stretched[: height - top]
                image[top : top + len(part), column] = part
        way: Literal["up", "down", "right"] = "up" if sampling.is_upward else "down"
        flat = image.reshape(height, -1, 3)
        if strip.band.is_upright:
            way, is_down = "right", strip.band.start[1] < strip.band.end[1]
            across = image[:, :, :: 1 if is_down else -1].transpose(1, 2, 0, 3)
            flat = across.reshape(-1, height, 3)
        luma, blue, red = (np.ascontiguousarray(layer) for layer in np.moveaxis(flat, 2, 0))
        flat = self._coding.to_bgr((luma, blue, red))
        picture = StripPicture(number, self._minute, columns, seconds, height, way, lead)
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

    def _add_moment(self, number: int, passage: BandPassage, image: Image) -> None:
        """Write the frame in which a vehicle passes a line, if it will be doubtful.

        A trace beside it is known only later: until then the frame is kept, reduced.
        """
        moment = self._moment(number, passage, image)
        track = next(track for track in self._tracks[-1].tracks if track.id == passage.id)
        if self._corrections or round(track.score, 4) < _UNSURE:
            self._write(_moment_name(number, passage), moment)
        else:
            self._undecided.append((number, passage, moment))

    def _write_beside(self, *, is_end: bool) -> None:
        """Write the undecided frames beside traces, and drop those beside which none will come."""
        undecided, self._undecided = self._undecided, []
        for number, passage, moment in undecided:
            if _is_beside(number, passage.time, self._traces):
                self._write(_moment_name(number, passage), moment)
            elif not is_end and self._tracks[-1].time - passage.time < DELAY + _BESIDE:
                self._undecided.append((number, passage, moment))

    def _moment(self, number: int, passage: BandPassage, image: Image) -> Image:
        """Return the frame, reduced, with the vehicle's box, the line and its path."""
        sides = (side for t in self._tracks[-1].tracks for side in (t.box.width, t.box.height))
        small = self._reduced(image, _MOMENT_WIDTH, largest=max(sides)).copy()
        tracks = [t for item in self._tracks for t in item.tracks if t.id == passage.id]
        band, box = self._strips[number].band, tracks[-1].box
        scale = small.shape[1] / image.shape[1]
        feet = [track.foot for track in tracks]
        for points, color in (((band.start, band.end), draw.LINE), (feet, draw.GREEN)):
            draw.draw_lines(small, [(scale * x, scale * y) for x, y in points], color, 1)
        corners = (scale * side for side in (box.x1, box.y1, box.x2, box.y2))
        draw.draw_box(small, Box(*corners), draw.GREEN)
        return small

    def _reduced(self, image: Image, width: int, largest: float) -> Image:
        """Return an image of a width at most, as `output.coarse` allows; `largest` is a vehicle."""
        scale = coarse_scale(largest, len(image)) if self._settings.output.coarse else 1.0
        return shrunk(image, min(scale, width / image.shape[1]))

    def _write(self, name: str, image: Image) -> None:
        _, data = cv2.imencode(".webp", image, [cv2.IMWRITE_WEBP_QUALITY, _QUALITY])
        (self._folder / name).write_bytes(data.tobytes())

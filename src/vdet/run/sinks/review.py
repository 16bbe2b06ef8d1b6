"""The sink `review`: strips of all lines with the counted crossings, in one page."""

import tempfile
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np

from vdet.boxes import Image
from vdet.errors import OutputError
from vdet.media import Picture
from vdet.media.frame import Coding
from vdet.media.images import coarse_scale, shrunk
from vdet.pages.batch import write_reviews
from vdet.pages.review import PAGE_NAME, EventMark, Review, StripPicture, crop_name, write_review
from vdet.run.result import FINDINGS, FrameResult, findings_in
from vdet.run.sinks.protocol import BaseSink, BatchTotal, SinkContext, SinkKind
from vdet.track.track import FrameTracks
from vdet.traffic.correcting import correct
from vdet.traffic.counts import Event, Trace
from vdet.traffic.records import Crop
from vdet.traffic.strips import (
    Band,
    BandPassage,
    Passages,
    Sampling,
    bands_of,
    sampling_of,
)
from vdet.traffic.traces import TraceSearch

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


@dataclass(frozen=True, slots=True, order=True)
class _Spot:
    """Where the mark of an event may be, and how many `seconds` from it a track passes there."""

    seconds: float
    band: int | None
    position: float


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


class ReviewSink(BaseSink):
    """Writes pictures while the video is read, strips minute by minute, and the page at the end."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        super().__init__(path, context)
        if not context.settings.traffic:
            raise OutputError(f"{path}: no lines or zones to review; add them to the settings")
        counter = self.traffic.counter
        assert counter  # the settings have lines or zones
        self._file = context.files.stage_folder(path) / PAGE_NAME
        bands = bands_of((*counter.lines, *counter.zones))
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

    def __exit__(self, kind: object, *_: object) -> None:
        with self._folder:
            if kind is None:
                self.finish()

    def write(self, result: FrameResult) -> None:
        """Add a frame to all strips."""
        seconds = float(result.frame.time)
        if (minute := int(seconds // _MINUTE)) != self._minute:
            self._end_minute(is_end=False)
            self._minute = minute
        picture = result.frame.picture
        self._coding = picture.planes.coding if picture.planes else None
        tracks = (*result.tracks, *result.unselected)
        self._tracks.append(FrameTracks(result.frame.index, float(result.frame.time), tracks))
        self._passages.add(self._tracks[-1])
        for strip, passages in zip(self._strips, self._passages.by_band, strict=True):
            strip.add(seconds - _MINUTE * minute, picture, passages)
        self._write_crops(self.context.crops.add(result.frame_tracks, picture))

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
        rate = sampling.rows * float(self.video.rate)  # rows a second
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
        if not self.context.settings.output.coarse:
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

    def finish(self) -> None:
        """Write the page."""
        self._end_minute(is_end=True)
        self._add_traces()
        self._write_crops(self.context.crops.end())
        counts, counted, opened = self.traffic.counts(), self.traffic.counted, None
        assert counts
        assert counted
        if reviewed := self.traffic.corrections:
            settings = self.context.settings.model_copy(update={"classes": ()})
            opened = correct({"": counted}, {"": reviewed}, settings)[""].corrected
        corrections = opened.corrections if opened else ()
        review = Review(
            video=self.video,
            traffic=self.context.settings.traffic,
            bands=[strip.band for strip in self._strips],
            pictures=self._pictures,
            marks=self._marks(counted.events),
            traces=counts.traces,
            findings=counts.findings,
            counted=counted,
            opened=opened,
            reviewed=reviewed,
            added=self._marks([c.right for c in corrections if c.right and not c.counted]),
        )
        with self._file.open("w", encoding="utf-8", errors="backslashreplace") as file:
            write_review(file, review, Path(self._folder.name))
        self.summary = {
            "page": f"{self.path.name}/{PAGE_NAME}",
            "key": review.key,
            "vehicles": len({event.vehicle for event in counted.events}),
            "minutes": len({picture.minute for picture in self._pictures}),
        }

    def _add_traces(self) -> None:
        """Add the traces to the counts, and the findings about them to the facts."""
        self.traffic.add_traces(sorted(self._traces, key=lambda trace: trace.time))
        if counts := self.traffic.counts():
            facts = self.context.facts
            facts[FINDINGS] = replace(findings_in(facts), items=counts.findings)

    def _marks(self, events: Sequence[Event]) -> list[EventMark]:
        """Return where the counted events are."""
        by_band_and_id: dict[tuple[int, int], list[BandPassage]] = defaultdict(list)
        for number, passages in enumerate(self._passages.by_band):
            for passage in passages:
                by_band_and_id[number, passage.id].append(passage)
        marks = []
        for event in events:
            bands = [
                number
                for number, strip in enumerate(self._strips)
                if strip.band.name == event.name and event.direction in strip.band.directions
            ]
            spots = [
                _Spot(abs(passage.time - event.time), band, passage.position)
                for band in bands
                for passage in by_band_and_id.get((band, event.id), ())
            ]
            spots += [_Spot(_SAME, band, 0.5) for band in bands]  # if there is no passage
            spot = min(spots, default=_Spot(0.0, None, 0.5))
            seconds = round(event.time, 3)
            marks.append(EventMark(spot.band, seconds, round(spot.position, 3), event))
        return marks


_LIST = BatchTotal("reviews", write_reviews, ".html", of_failed=lambda error: {"error": error})
REVIEW = SinkKind(
    ReviewSink,
    what="reviews",
    folder_pattern=PAGE_NAME,
    takes="videos",
    total=_LIST,
    finish_order=-1,
)

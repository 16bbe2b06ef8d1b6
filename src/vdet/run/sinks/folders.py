"""The sinks that write a folder: `stages`, `crops`, `clips`, `page` and `review`."""

import logging
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from vdet.boxes import Image
from vdet.config.classes import UNKNOWN, in_file_name
from vdet.config.rendering import render_settings
from vdet.draw.boxes import WHITE, color_of, draw_box, draw_label, draw_regions
from vdet.errors import OutputError, VideoError, clock_text
from vdet.files import write_text
from vdet.lanes.road import stage_images
from vdet.media.demux import is_pipe, plays_in_some_browser
from vdet.media.images import encode_image, is_image_name
from vdet.media.writer import can_be_copied, copy_part, encode_part, is_marked
from vdet.pages.batch import write_index, write_reviews
from vdet.pages.render import PAGE_NAME, REVIEW_NAME, link_to, thumbnail, webp_uri
from vdet.pages.video import Player, VideoPage, longest
from vdet.regions import Regions
from vdet.run.sinks.drawn import IMAGE_LABELS
from vdet.run.sinks.protocol import BaseSink, BatchTotal, SinkContext, SinkKind
from vdet.run.steps import FINDINGS, FrameResult, findings_in
from vdet.track.track import Track
from vdet.traffic.clock import Clock, Span, extend
from vdet.traffic.live import LiveTraffic
from vdet.traffic.records import Crop, VehicleRecord

log = logging.getLogger("vdet")

_BOXES = "boxes"
_GREY = 160, 160, 160
_CROP_NAME = re.compile(r"vehicle-\d{4,}(-[\w-]+)?-at--?\d+\.\d{3}s\.jpg")
_GAP = 1.0  # minimum seconds between two frames that the page calls a gap
_PICTURE_NAME = re.compile(r"vehicle-\d+\.webp")


class StagesSink(BaseSink):
    """Writes stage images of the first searched frame at or after the time `SinkContext.at`."""

    _is_done = False

    def __init__(self, path: Path, context: SinkContext) -> None:
        super().__init__(path, context)
        self._tracks: dict[int, Track] = {}

    def finish(self) -> None:
        """Raise `OutputError` if there is no frame at this time."""
        if not self._is_done:
            source = self.context.video.path if self.context.video else self.path
            at = float(self.context.at)
            raise OutputError(f"{source}: no frame at {at:.2f} s or later; use an earlier time")

    def write(self, result: FrameResult) -> None:
        """Write the images if this is the frame."""
        if self._is_done or not result.searched or result.frame.time < self.context.at:
            self._tracks.update((track.id, track) for track in result.tracks)
            return
        self._is_done = True
        pictures = self.context.stage_images(result.frame.image, result.detections)
        height, width = result.frame.image.shape[:2]
        if self.context.settings.regions:
            regions = Regions(self.context.settings.regions, width, height)
            pictures["regions"] = draw_regions(result.frame.image, regions)
        pictures[_BOXES] = _with_boxes(result)
        if self.context.video and (result.tracks or self._tracks):
            pictures["tracks"] = _with_states(result, self._tracks)
        if result.road:
            pictures |= stage_images(result.road, result.frame.image)
        folder = self.context.files.stage_folder(self.path)
        for number, (name, picture) in enumerate(pictures.items(), start=1):
            path = folder / f"{number:0{len(str(len(pictures)))}}-{name}.png"  # in order
            path.write_bytes(encode_image(picture, path))


def _with_boxes(result: FrameResult) -> Image:
    """Draw the detections in white with their scores, and the shown vehicles over them."""
    picture = result.frame.image.copy()
    detections = result.detections
    for detection in detections:
        draw_box(picture, detection.box, WHITE)
        draw_label(picture, f"{detection.score:.2f}", (detection.box.x1, detection.box.y2), WHITE)
    result.draw_tracks(picture, IMAGE_LABELS[-1])
    return picture


def _with_states(result: FrameResult, earlier: Mapping[int, Track]) -> Image:
    """Draw the tracks with their states, and where earlier ones were lost, which are grey."""
    picture, shown = result.frame.image.copy(), {track.id for track in result.tracks}
    lost = [track for number, track in earlier.items() if number not in shown]
    for track in lost:
        draw_box(picture, track.box, _GREY, f"#{track.id} lost", dashed=True)
    for track in result.tracks:
        is_dashed, text = track.state == "predicted", f"#{track.id} {track.state}"
        draw_box(picture, track.box, color_of(track.id), text, dashed=is_dashed)
    return picture


STAGES = SinkKind(StagesSink, what="stages", folder_pattern=f"*-{_BOXES}.png", uses_traffic=False)


class CropSink(BaseSink):
    """Writes the image of a vehicle when it is gone; a better one later replaces it."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        super().__init__(path, context)
        self._folder = context.files.stage_folder(path, _is_crop)
        self._written: dict[int, tuple[float, Path]] = {}

    def finish(self) -> None:
        """Write the images of vehicles still shown, and name those of all recorded vehicles."""
        self._write_all(self.context.crops.end())
        for vehicle in self.traffic.vehicles:
            if vehicle.id in self._written:
                time, path = self._written.pop(vehicle.id)
                path.rename(self._folder / _crop_name(vehicle, time))
        for _, path in self._written.values():
            path.unlink()

    def write(self, result: FrameResult) -> None:
        """Look for better images in a frame."""
        self._write_all(self.context.crops.add(result.frame_tracks, result.frame.picture))

    def _write_all(self, crops: list[Crop]) -> None:
        for crop in crops:
            path = self._folder / f"{crop.id}.jpg"
            path.write_bytes(encode_image(crop.image, path))
            self._written[crop.id] = crop.time, path


def _is_crop(path: Path) -> bool:
    return _CROP_NAME.fullmatch(path.name) is not None


def _crop_name(vehicle: VehicleRecord, time: float) -> str:
    kind = in_file_name(vehicle.class_name)
    parts = ["vehicle", f"{vehicle.id:04d}", *([] if kind == UNKNOWN else [kind])]
    return f"{'-'.join(parts)}-at-{time:.3f}s.jpg"


CROPS = SinkKind(
    CropSink, what="images of vehicles", folder_pattern="vehicle-*-at-*s.*", takes="videos"
)


class PageSink(BaseSink):
    """Collects what the page shows, and writes it at the end."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        super().__init__(path, context)
        self._folder = context.files.stage_folder(path, _is_picture)
        self._pictures: dict[int, Path] = {}
        self._spans: list[Span] = []
        self._frames = 0

    def finish(self) -> None:
        """Write the page."""
        self._keep(self.context.crops.end())
        for number in self._pictures.keys() - {vehicle.id for vehicle in self.traffic.vehicles}:
            self._pictures.pop(number).unlink()
        page = self._page()
        self.summary = {"page": f"{self.path.name}/{PAGE_NAME}", **page.summary}
        write_text(self._folder / PAGE_NAME, page.html())

    def write(self, result: FrameResult) -> None:
        """Add a frame."""
        frame, picture = result.frame_tracks, result.frame.picture
        extend(self._spans, frame.time, _GAP)
        self._frames += 1
        self.context.poster.add(result)
        self._keep(self.context.crops.add(frame, picture))

    def _keep(self, crops: list[Crop]) -> None:
        for crop in crops:
            self._pictures[crop.id] = self._folder / f"vehicle-{crop.id}.webp"
            self._pictures[crop.id].write_bytes(thumbnail(crop.image))

    def _page(self) -> VideoPage:
        settings, traffic = self.context.settings, self.traffic
        review, poster = self.context.path_of("review"), self.context.poster.image(traffic.vehicles)
        return VideoPage(
            video=self.video,
            frames=self._frames,
            spans=self._spans or [(0.0, 0.0)],
            records=traffic.vehicles,
            thumbnails={
                record.id: webp_uri(self._pictures[record.id].read_bytes())
                for record in longest(traffic.vehicles)
                if record.id in self._pictures
            },
            poster=poster,
            still=self.context.poster.with_boxes(poster),
            player=self._player(),
            settings=render_settings(settings.with_paths(lambda path: Path(path).name)),
            survey=self.context.survey,
            interval=settings.traffic.seconds or 60,
            clock=traffic.clock,
            pictures={number: path.name for number, path in self._pictures.items()},
            findings=findings_in(self.context.facts).items,
            clips={n: link_to(path, self.path) for n, path in self.context.clip_files.items()},
            review=link_to(review / REVIEW_NAME, self.path) if review else "",
            index=_index(self, "page"),
        )

    def _player(self) -> Player | None:
        """Return the video that this run writes, else the source if a browser plays it."""
        source = self.video.path
        drawn = self.context.path_of("video")
        is_file = source.is_file() and not is_image_name(source)
        if not drawn and not (is_file and plays_in_some_browser(source)):
            return None
        path, start = source, 0.0
        if drawn:
            path, start = drawn, self._spans[0][0] if self._spans else start
        return Player(path.name, link_to(path, self.path), bool(drawn), start)


def _is_picture(path: Path) -> bool:
    return _PICTURE_NAME.fullmatch(path.name) is not None


def _index(sink: BaseSink, name: str) -> str:
    """Return the address of the file over all videos of the batch for pages; empty without one."""
    path = sink.context.path_of(name, in_batch=True)
    return link_to(path, sink.path) if path else ""


_INDEX = BatchTotal("index", write_index, ".html", of_failed=lambda error: {"error": error})
PAGE = SinkKind(
    PageSink, what="pages", folder_pattern=PAGE_NAME, takes="videos", total=_INDEX, finish_order=1
)


_CLIP_NAME = re.compile(
    r"clip-(\d{2,}|\d{4}-\d\d-\d\dT\d\d)-\d\d-\d\d-[\w-]+-\d+(\+\d+)?\.(mp4|mov|mkv)"
)
_PRECISION = 1_000_000  # largest denominator of a time, seconds


@dataclass(frozen=True, slots=True)
class ClipSpan:
    """A time span in which vehicles are shown, with its margins; seconds in the video."""

    start: float
    end: float
    vehicles: tuple[VehicleRecord, ...]

    def name(self, clock: Clock | None) -> str:
        """Return the name of its clip, without suffix."""
        first, *others = self.vehicles
        moment = clock_text(int(first.first), hours=True).zfill(8).replace(":", "-")
        if clock:
            moment = clock.at(first.first).strftime("%Y-%m-%dT%H-%M-%S")
        more = f"+{len(others)}" if others else ""
        return f"clip-{moment}-{in_file_name(first.class_name)}-{first.id}{more}"


def counted_vehicles(traffic: LiveTraffic) -> Sequence[VehicleRecord]:
    """Return the vehicles that were counted; all without lines and zones."""
    counts = traffic.counts()
    counted = {event.id for event in counts.events} if counts else ()
    return [record for record in traffic.vehicles if counts is None or record.id in counted]


def scenes(records: Iterable[VehicleRecord], margin: float) -> list[ClipSpan]:
    """Return the time spans of vehicles with margins, seconds; spans that touch are joined."""
    found: list[ClipSpan] = []
    for record in sorted(records, key=lambda record: record.first):
        scene = ClipSpan(record.first - margin, record.last + margin, (record,))
        if found and scene.start <= found[-1].end:
            last = found.pop()
            vehicles = (*last.vehicles, record)
            scene = ClipSpan(last.start, max(scene.end, last.end), vehicles)
        found.append(scene)
    return found


class ClipSink(BaseSink):
    """Cuts the clips at the end of the run; with lines or zones, only of counted vehicles.

    The video is read a second time: if it is no longer the same file then, there are no clips.
    """

    def __init__(self, path: Path, context: SinkContext) -> None:
        super().__init__(path, context)
        if is_pipe(self.video.path):
            what = "can be read only once, so no clips can be cut out of it"
            raise OutputError(f"{self.video.path}: {what}; save it to a file first")
        self._state = _state(self.video.path)
        is_exact = context.settings.clips.exact
        self._is_copied = not is_exact and can_be_copied(self.video.path)

    def finish(self) -> None:
        """Write the clips. One that cannot be cut is left out, with a warning."""
        folder = self.context.files.stage_folder(self.path, is_clip)
        source = self.video.path
        if _state(source) != self._state:
            log.warning("%s: changed during the run, so no clips were cut out of it", source)
            return
        for scene in scenes(counted_vehicles(self.traffic), self.context.settings.clips.margin):
            name = scene.name(self.traffic.clock)
            try:
                clip = self._cut(scene, folder / name)
                files = dict.fromkeys((item.id for item in scene.vehicles), self.path / clip.name)
                self.context.clip_files.update(files)
            except (OutputError, VideoError) as error:
                if isinstance(error.__cause__, OSError):  # such as a full disk
                    raise
                (folder / f"{name}.mp4").unlink(missing_ok=True)
                log.warning("%s: the clip %s was not written: %s", source, name, error)

    def _cut(self, scene: ClipSpan, stem: Path) -> Path:
        """Copy or encode a scene, and return its file; a part that cannot be copied is encoded."""
        video, sides = self.video, (scene.start, scene.end)
        start, end = (Fraction(side).limit_denominator(_PRECISION) for side in sides)
        end += 1 / video.rate / 2  # the frame at the end is shown too
        target = stem.with_name(f"{stem.name}.mp4")
        if self._is_copied:
            try:
                copy_part(video.path, video.start + start, video.start + end, target)
                return target
            except OutputError as error:
                target.unlink(missing_ok=True)
                log.debug("%s; encoded instead", error)
        name, first = self.path / target.name, max(start, Fraction(0))
        encode_part(video.path, first, end, target, self.context.settings, name=name)
        return target


def is_clip(path: Path) -> bool:
    """Return whether a file is a clip that vdet wrote."""
    return _CLIP_NAME.fullmatch(path.name) is not None and is_marked(path)


def _may_replace(path: Path) -> bool:
    return is_clip(path) or _CLIP_NAME.fullmatch(path.name) is None


def _state(path: Path) -> tuple[int, int, int, int] | None:
    """Return what changes when a file is replaced or written; None if it does not exist."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


CLIPS = SinkKind(
    ClipSink, what="clips", folder_pattern="clip-*.*", takes="videos", may_replace=_may_replace
)


class ReviewSink(BaseSink):
    """Writes the page on which the counts are checked."""

    def __init__(self, path: Path, context: SinkContext) -> None:
        super().__init__(path, context)
        if not context.settings.traffic:
            raise OutputError(f"{path}: no lines or zones to review; add them to the settings")
        from vdet.review.page import ReviewRecorder  # most runs load nothing of it

        counter = self.traffic.counter
        assert counter  # the settings have lines or zones
        self._file = context.files.stage_folder(path) / REVIEW_NAME
        self._recorder = ReviewRecorder(
            self.video, context.settings, counter.borders, context.crops, context.corrections
        )

    def __exit__(self, kind: Any, *_: object) -> None:
        with self._recorder:
            super().__exit__(kind)

    def write(self, result: FrameResult) -> None:
        """Add a frame to all strips."""
        frame = replace(result.frame_tracks, tracks=(*result.tracks, *result.unselected))
        self._recorder.add(frame, result.frame_tracks, result.frame.picture)

    def finish(self) -> None:
        """Write the page, and add the traces to the counts, and the findings about them."""
        from vdet.review.traces import with_traces

        traffic, facts = self.traffic, self.context.facts
        counts = traffic.counts()
        assert counts
        traffic.revise(with_traces(counts, self._recorder.end()))
        counts, counted = traffic.counts(), traffic.counted
        assert counts
        assert counted
        facts[FINDINGS] = replace(findings_in(facts), items=counts.findings)
        facts_of_page = self._recorder.write(self._file, counted, counts, _index(self, "review"))
        self.summary = {"page": f"{self.path.name}/{REVIEW_NAME}", **facts_of_page}


_LIST = BatchTotal("reviews", write_reviews, ".html", of_failed=lambda error: {"error": error})
REVIEW = SinkKind(
    ReviewSink,
    what="reviews",
    folder_pattern=REVIEW_NAME,
    takes="videos",
    total=_LIST,
    finish_order=-1,
)

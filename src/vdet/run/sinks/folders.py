"""The sinks that write a folder: `stages`, `crops`, `clips`, `page` and `review`."""

import logging
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from vdet.boxes import Image
from vdet.config.classes import UNKNOWN, in_file_name
from vdet.config.schema import Settings
from vdet.draw import WHITE, color_of, draw_box, draw_label, draw_regions
from vdet.errors import OutputError, VideoError, clock_text
from vdet.files import write_text
from vdet.lanes.road import stage_images
from vdet.media import VideoInfo
from vdet.media.images import encode_image, is_image_name
from vdet.media.reader import is_pipe, plays_in_some_browser
from vdet.media.writer import can_be_copied, copy_part, encode_part, is_marked
from vdet.pages.render import PAGE_NAME, REVIEW_NAME, link_to, thumbnail, webp_uri
from vdet.pages.video import Player, VideoPage, longest, write_index, write_reviews
from vdet.regions import Regions
from vdet.run.sinks.drawn import IMAGE_LABELS
from vdet.run.sinks.protocol import BatchTotal, SinkContext, Writing, sink
from vdet.run.steps import FINDINGS, FrameResult, findings_in
from vdet.track.track import Track
from vdet.traffic.clock import Clock, Span, extend
from vdet.traffic.records import Crop, VehicleRecord

log = logging.getLogger("vdet")

_BOXES = "boxes"
_GREY = 160, 160, 160
_CROP_NAME = re.compile(r"vehicle-\d{4,}(-[\w-]+)?-at--?\d+\.\d{3}s\.jpg")
_GAP = 1.0  # minimum seconds between two frames that the page calls a gap
_PICTURE_NAME = re.compile(r"vehicle-\d+\.webp")
_CLIP_NAME = re.compile(
    r"clip-(\d{2,}|\d{4}-\d\d-\d\dT\d\d)-\d\d-\d\d-[\w-]+-\d+(\+\d+)?\.(mp4|mov|mkv)"
)
_PRECISION = 1_000_000  # largest denominator of a time, seconds


_INDEX = BatchTotal("index", write_index, ".html", of_failed=lambda error: {"error": error})
_LIST = BatchTotal("reviews", write_reviews, ".html", of_failed=lambda error: {"error": error})


def _is_named(pattern: re.Pattern[str], path: Path) -> bool:
    """Return whether the name of a file is one that vdet gives."""
    return pattern.fullmatch(path.name) is not None


@sink(what="stages", folder_pattern=f"*-{_BOXES}.png", uses_traffic=False)
def stages(path: Path, context: SinkContext) -> Writing:
    """Write stage images of the first searched frame at or after the time `SinkContext.at`.

    Raises `OutputError` if there is none.
    """
    earlier: dict[int, Track] = {}
    while result := (yield):
        if result.searched and result.frame.time >= context.at:
            break
        earlier.update((track.id, track) for track in result.tracks)
    else:
        source, at = context.video.path if context.video else path, float(context.at)
        raise OutputError(f"{source}: no frame at {at:.2f} s or later; use an earlier time")
    image = result.frame.image
    pictures = context.stage_images(image, result.detections)
    if context.settings.regions:
        regions = Regions(context.settings.regions, image.shape[1], image.shape[0])
        pictures["regions"] = draw_regions(image, regions)
    pictures[_BOXES] = _with_boxes(result)
    if context.video and (result.tracks or earlier):
        pictures["tracks"] = _with_states(result, earlier)
    if result.road:
        pictures |= stage_images(result.road, image)
    folder = context.files.stage_folder(path)
    for number, (name, picture) in enumerate(pictures.items(), start=1):
        file = folder / f"{number:0{len(str(len(pictures)))}}-{name}.png"  # in order
        file.write_bytes(encode_image(picture, file))
    while (yield):
        pass


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


@sink(what="images of vehicles", folder_pattern="vehicle-*-at-*s.*", takes="videos")
def crops(path: Path, context: SinkContext) -> Writing:
    """Write the image of a vehicle when it is gone; a better one later replaces it.

    At the end, the images of recorded vehicles get their names.
    """
    _, traffic = context.of_video
    folder = context.files.stage_folder(path, partial(_is_named, _CROP_NAME))
    written: dict[int, tuple[float, Path]] = {}

    def write(crops: Iterable[Crop]) -> None:
        for crop in crops:
            file = folder / f"{crop.id}.jpg"
            file.write_bytes(encode_image(crop.image, file))
            written[crop.id] = crop.time, file

    while result := (yield):
        write(context.crops.add(result.frame_tracks, result.frame.picture))
    write(context.crops.end())
    for vehicle in traffic.vehicles:
        if vehicle.id in written:
            time, file = written.pop(vehicle.id)
            file.rename(folder / _crop_name(vehicle, time))
    for _, file in written.values():
        file.unlink()


def _crop_name(vehicle: VehicleRecord, time: float) -> str:
    kind = in_file_name(vehicle.class_name)
    parts = ["vehicle", f"{vehicle.id:04d}", *([] if kind == UNKNOWN else [kind])]
    return f"{'-'.join(parts)}-at-{time:.3f}s.jpg"


@sink(what="pages", folder_pattern=PAGE_NAME, takes="videos", total=_INDEX, finish_order=1)
def page(path: Path, context: SinkContext) -> Writing:
    """Collect what the page shows, and write it at the end."""
    video, traffic = context.of_video
    folder = context.files.stage_folder(path, partial(_is_named, _PICTURE_NAME))
    pictures, spans, frames = dict[int, Path](), list[Span](), 0

    def keep(crops: Iterable[Crop]) -> None:
        for crop in crops:
            pictures[crop.id] = folder / f"vehicle-{crop.id}.webp"
            pictures[crop.id].write_bytes(thumbnail(crop.image))

    while result := (yield):
        extend(spans, result.frame_tracks.time, _GAP)
        frames += 1
        context.poster.add(result)
        keep(context.crops.add(result.frame_tracks, result.frame.picture))
    keep(context.crops.end())
    for number in pictures.keys() - {vehicle.id for vehicle in traffic.vehicles}:
        pictures.pop(number).unlink()
    review, poster = context.path_of("review"), context.poster.image(traffic.vehicles)
    page = VideoPage(
        video=video,
        frames=frames,
        spans=spans or [(0.0, 0.0)],
        records=traffic.vehicles,
        thumbnails={
            record.id: webp_uri(pictures[record.id].read_bytes())
            for record in longest(traffic.vehicles)
            if record.id in pictures
        },
        poster=poster,
        still=context.poster.with_boxes(poster),
        player=_player(path, context, spans),
        settings=context.settings,
        survey=context.survey,
        clock=traffic.clock,
        pictures={number: picture.name for number, picture in pictures.items()},
        findings=findings_in(context.facts).items,
        clips={number: link_to(clip, path) for number, clip in context.clip_files.items()},
        review=link_to(review / REVIEW_NAME, path) if review else "",
        index=_index(path, context, "page"),
    )
    write_text(folder / PAGE_NAME, page.html())
    return {"page": f"{path.name}/{PAGE_NAME}", **page.summary}


def _player(path: Path, context: SinkContext, spans: Sequence[Span]) -> Player | None:
    """Return the video that this run writes, else the source if a browser plays it."""
    video, _ = context.of_video
    if drawn := context.path_of("video"):
        return Player(drawn.name, link_to(drawn, path), True, spans[0][0] if spans else 0.0)
    is_file = video.path.is_file() and not is_image_name(video.path)
    if not (is_file and plays_in_some_browser(video.path)):
        return None
    return Player(video.path.name, link_to(video.path, path), False, 0.0)


def _index(path: Path, context: SinkContext, name: str) -> str:
    """Return the address of the file over all videos of the batch for pages; empty without one."""
    index = context.path_of(name, in_batch=True)
    return link_to(index, path) if index else ""


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


def is_clip(path: Path) -> bool:
    """Return whether a file is a clip that vdet wrote."""
    return _is_named(_CLIP_NAME, path) and is_marked(path)


def _may_replace(path: Path) -> bool:
    return is_clip(path) or not _is_named(_CLIP_NAME, path)


@sink(what="clips", folder_pattern="clip-*.*", takes="videos", may_replace=_may_replace)
def clips(path: Path, context: SinkContext) -> Writing:
    """Cut the clips at the end of the run; with lines or zones, only of counted vehicles.

    The video is read a second time: if it is no longer the same file then, there are no clips. One
    that cannot be cut is left out, with a warning.
    """
    video, traffic = context.of_video
    source, settings = video.path, context.settings
    if is_pipe(source):
        what = "can be read only once, so no clips can be cut out of it"
        raise OutputError(f"{source}: {what}; save it to a file first")
    state = _state(source)
    is_copied = not settings.clips.exact and can_be_copied(source)
    while (yield):
        pass
    folder = context.files.stage_folder(path, is_clip)
    if _state(source) != state:
        log.warning("%s: changed during the run, so no clips were cut out of it", source)
        return
    counts = traffic.counts()
    counted = {event.id for event in counts.events} if counts else ()
    shown = (item for item in traffic.vehicles if counts is None or item.id in counted)
    for scene in scenes(shown, settings.clips.margin):
        clip = path / f"{scene.name(traffic.clock)}.mp4"
        try:
            _cut(scene, video, clip, folder / clip.name, settings, is_copied=is_copied)
            context.clip_files.update(dict.fromkeys((item.id for item in scene.vehicles), clip))
        except (OutputError, VideoError) as error:
            if isinstance(error.__cause__, OSError):  # such as a full disk
                raise
            (folder / clip.name).unlink(missing_ok=True)
            log.warning("%s: the clip %s was not written: %s", source, clip.stem, error)


def _cut(
    scene: ClipSpan,
    video: VideoInfo,
    clip: Path,
    target: Path,
    settings: Settings,
    *,
    is_copied: bool,
) -> None:
    """Copy or encode a scene into `target`, later `clip`; what cannot be copied is encoded."""
    sides = (scene.start, scene.end)
    start, end = (Fraction(side).limit_denominator(_PRECISION) for side in sides)
    end += 1 / video.rate / 2  # the frame at the end is shown too
    if is_copied:
        try:
            copy_part(video.path, video.start + start, video.start + end, target)
            return
        except OutputError as error:
            target.unlink(missing_ok=True)
            log.debug("%s; encoded instead", error)
    encode_part(video.path, max(start, Fraction(0)), end, target, settings, name=clip)


def _state(path: Path) -> tuple[int, int, int, int] | None:
    """Return what changes when a file is replaced or written; None if it does not exist."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


@sink(what="reviews", folder_pattern=REVIEW_NAME, takes="videos", total=_LIST, finish_order=-1)
def review(path: Path, context: SinkContext) -> Writing:
    """Write the page on which the counts are checked.

    At the end, add the traces to the counts, and the findings about them.
    """
    if not context.settings.traffic:
        raise OutputError(f"{path}: no lines or zones to review; add them to the settings")
    from vdet.review.page import ReviewRecorder, crop_name  # most runs load nothing of it
    from vdet.review.strips import with_traces

    (video, traffic), facts = context.of_video, context.facts
    assert traffic.counter  # the settings have lines or zones
    file, borders = context.files.stage_folder(path) / REVIEW_NAME, traffic.counter.borders
    with TemporaryDirectory() as folder:
        pictures, given = Path(folder), context.corrections
        recorder = ReviewRecorder(pictures, video, context.settings, borders, given)

        def keep(crops: Iterable[Crop]) -> None:
            for crop in crops:
                (pictures / crop_name(crop.id)).write_bytes(thumbnail(crop.image))

        while result := (yield):
            frame, picture = result.frame_tracks, result.frame.picture
            every = replace(frame, tracks=(*result.tracks, *result.unselected))
            recorder.add(every, picture)
            keep(context.crops.add(frame, picture))
        keep(context.crops.end())
        counts = traffic.counts()
        assert counts
        traffic.revise(with_traces(counts, recorder.end()))
        counts, counted = traffic.counts(), traffic.counted
        assert counts
        assert counted
        facts[FINDINGS] = replace(findings_in(facts), items=counts.findings)
        facts_of_page = recorder.write(file, counted, counts, _index(path, context, "review"))
    return {"page": f"{path.name}/{REVIEW_NAME}", **facts_of_page}

"""Vehicles, and the lane, in pictures: read, detected, drawn, listed."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vdet.config.schema import Settings
from vdet.detect.svm.detector import detect_still, still_boxes
from vdet.detect.svm.model import LinearModel
from vdet.detect.svm.stages import LabelledBox, check_stages, write_stages
from vdet.draw.boxes import color_of, draw_box
from vdet.errors import ConfigError, ImageError, OutputError
from vdet.files import check_output, make_folder
from vdet.geometry import Box
from vdet.lanes.drawing import draw_lane
from vdet.lanes.lane import Lane
from vdet.lanes.record import lane_record
from vdet.lanes.road import LaneRequest, Road, RoadWatch
from vdet.media.images import PICTURE_SUFFIXES, Image, read_image, write_image
from vdet.pipeline.annotation import write_lane_stages
from vdet.pipeline.threads import quiet_libraries


@dataclass(frozen=True, slots=True)
class StillJob:
    """A picture to be searched, and where its results go (None: nowhere)."""

    source: Path
    picture: Path | None
    stages: Path | None


@dataclass(frozen=True, slots=True)
class StillResult:
    """Boxes found in a picture of `width` × `height` pixels, each with its region's peak heat.

    Boxes are in pixels of the picture as it was read; `lane`, in those of the undistorted one, is
    looked for where `with_lane` says so, and None where none is shown.
    """

    source: Path
    width: int
    height: int
    boxes: tuple[tuple[Box, float], ...]
    with_lane: bool = False
    lane: Lane | None = None


def find_images(paths: Sequence[Path]) -> list[Path]:
    """Return the pictures among `paths`, those in folders included (not in folders of these).

    Raises
    ------
    ImageError
        A path does not exist, or a folder holds no picture.
    """
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            inside = sorted(p for p in path.iterdir() if _is_picture(p))
            if not inside:
                raise ImageError(
                    f"{path}: holds no pictures ({', '.join(sorted(PICTURE_SUFFIXES))})"
                )
            found += inside
        elif path.exists():
            found.append(path)
        else:
            raise ImageError(f"{path}: no such file or folder")
    return list(dict.fromkeys(found))


def _is_picture(path: Path) -> bool:
    return (
        path.suffix.lower() in PICTURE_SUFFIXES and not path.name.startswith(".") and path.is_file()
    )


def plan(
    sources: Sequence[Path], out: Path | None, stages: Path | None, *, overwrite: bool
) -> list[StillJob]:
    """Decide where each picture's results go, and refuse what cannot be, before any work.

    `out` is a file for a single picture where it has a picture's suffix, else a folder, which is
    made; pictures keep their names in it. Stage pictures of several sources go to one folder each.

    Raises
    ------
    OutputError
        An output is there already (and not `overwrite`), equals a source, or is wanted twice.
    """
    single_file = out is not None and len(sources) == 1 and out.suffix.lower() in PICTURE_SUFFIXES
    jobs = []
    for source in sources:
        picture = out if single_file or out is None else out / source.name
        folder = stages / source.stem if stages and len(sources) > 1 else stages
        jobs.append(StillJob(source, picture, folder))
    pictures = [job.picture for job in jobs if job.picture]
    folders = [job.stages for job in jobs if job.stages]
    for wanted in (pictures, folders):
        if twice := [path for path in wanted if wanted.count(path) > 1]:
            raise OutputError(f"{twice[0]}: wanted by two inputs of one name; run them separately")
    if out is not None and not single_file:
        make_folder(out)
    for picture in pictures:
        check_output(picture, overwrite=overwrite, inputs=sources)
    for folder in folders:
        check_stages(folder, overwrite=overwrite)
    return jobs


def process_still(
    job: StillJob, model: LinearModel, settings: Settings, lanes: LaneRequest | None = None
) -> StillResult:
    """Search a picture and write what the job asks for. Raises `ImageError`, `OutputError`."""
    image = read_image(job.source)
    height, width = image.shape[:2]
    try:
        with quiet_libraries():
            detection = detect_still(model, settings, image)
    except ImageError as error:
        raise ImageError(f"{job.source}: {error}") from error
    road = _road(job.source, image, settings, lanes) if lanes else None
    boxes = still_boxes(detection, settings, width, height)
    labelled = [(box, f"heat {peak:.1f}") for box, peak in boxes]
    if job.stages:
        write_stages(job.stages, image, detection, labelled, features=model.features)
        if road:
            write_lane_stages(job.stages, road)
    if job.picture:
        write_image(job.picture, _annotated(image, labelled, road))
    lane = road.lane if road else None
    return StillResult(job.source, width, height, tuple(boxes), road is not None, lane)


def _road(source: Path, image: Image, settings: Settings, lanes: LaneRequest) -> Road:
    height, width = image.shape[:2]
    try:
        watch = RoadWatch(lanes, settings.lanes, width, height)
    except ConfigError as error:
        raise ImageError(f"{source}: {error}") from error
    return watch.follow(watch.look(image))


def _annotated(image: Image, boxes: Sequence[LabelledBox], road: Road | None) -> Image:
    """Draw boxes into the picture; with a road, and its lane, into the undistorted one."""
    if road:
        image = road.image
        boxes = [(road.place(box), label) for box, label in boxes]
        if road.lane:
            draw_lane(image, road.lane)
    for number, (box, label) in enumerate(boxes, start=1):
        if box.area:
            draw_box(image, box, color_of(number), label)
    return image


def list_results(results: Iterable[StillResult]) -> list[dict[str, Any]]:
    """Return results as plain values for JSON, an item a picture.

    Each item has `image`, `width`, `height` and `boxes`, a list of objects with `x`, `y`, `width`,
    `height` (pixels of the input picture) and `peak` (heat); where lanes were looked for also
    `lane` as in `.jsonl` tracks.
    """
    return [_item(result) for result in results]


def _item(result: StillResult) -> dict[str, Any]:
    item: dict[str, Any] = {
        "image": str(result.source),
        "width": result.width,
        "height": result.height,
        "boxes": [
            {
                "x": box.x,
                "y": box.y,
                "width": box.width,
                "height": box.height,
                "peak": round(peak, 3),
            }
            for box, peak in result.boxes
        ],
    }
    if result.with_lane:
        item["lane"] = lane_record(result.lane)
    return item

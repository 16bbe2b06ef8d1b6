"""Single images: read, searched, and passed to the sinks; and the files that commands read."""

import logging
import os
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

from vdet.boxes import Boxes, Image
from vdet.config.classes import is_chosen
from vdet.config.schema import Settings
from vdet.detect.detectors import DetectorModel, stage_images_of, warnings_of
from vdet.errors import ImageError
from vdet.files import FileIds, OutputFiles, file_ids, is_hidden
from vdet.media import Frame, Picture
from vdet.media.images import IMAGE_SUFFIXES, is_image_name, numbered_images, read_image
from vdet.regions import check_masks
from vdet.run.loop import named_errors
from vdet.run.sinks import Output
from vdet.run.sinks.protocol import SinkContext, check_sinks, open_sinks
from vdet.run.steps import FrameResult, ParallelStep, StepContext, make_steps
from vdet.track.track import Track
from vdet.workers import SearchThreads

_DATA_SUFFIXES = IMAGE_SUFFIXES | {".csv", ".json", ".txt", ".yaml", ".yml"}


_log = logging.getLogger("vdet")


def input_files(*paths: Path, settings: Settings | None = None) -> FileIds:
    """Identify the files at `paths`, and the model file, masks and picture of the settings.

    A folder stands for the images and labels in it, recursively, and a pattern such as
    `img_%04d.png` for its images. Raises `VideoError` if there is none of these, `ImageError` or
    `ConfigError` if a mask cannot be used.
    """
    files: list[Path] = []
    for path in paths:
        if path.is_dir():
            files += (file for file in path.rglob("*") if file.suffix.lower() in _DATA_SUFFIXES)
        else:
            files += numbered_images(path) or [path]
    if settings:
        check_masks(settings.regions)
        masks = (region.mask for region in settings.regions)
        named = [settings.detector.model, settings.survey.picture, *masks]
        files += map(Path, filter(None, named))
    return file_ids(files)


@dataclass(frozen=True, slots=True)
class ImageJob:
    """An image and its outputs.

    `name` is its path below the input folder; None: its file name.
    """

    source: Path
    outputs: tuple[Output, ...]
    name: Path | None = None


def find_images(paths: Sequence[Path]) -> dict[Path, Path]:
    """Return the images that `paths` name: files, and all images in folders, recursively.

    Each has its path below the folder; hidden files and folders are skipped.

    Raises
    ------
    ImageError
        A path does not exist, or a folder contains no image.
    """
    images: dict[Path, Path] = {}
    for path in paths:
        if path.is_dir():
            files = sorted(
                file for file in filter(is_image_name, path.rglob("*")) if file.is_file()
            )
            names = {file: file.relative_to(path) for file in files}
            names = {file: name for file, name in names.items() if not is_hidden(name)}
            if not names:
                suffixes = ", ".join(sorted(IMAGE_SUFFIXES))
                raise ImageError(f"{path}: contains no images ({suffixes})")
        elif path.exists():
            names = {path: Path(path.name)}
        else:
            raise ImageError(f"{path}: not found")
        images |= {file: name for file, name in names.items() if file not in images}
    return images


def plan_images(
    sources: Mapping[Path, Path], out: Path | None, stages: Path | None, files: OutputFiles
) -> list[ImageJob]:
    """Choose the outputs of each image, and check them before any work.

    Parameters
    ----------
    sources
        As `find_images` returns them.
    out
        A file, if there is a single source and `out` has the suffix of an image; else a folder, in
        which images keep their names and folders. None: no images.
    stages
        Folder of the stage images; with several sources, each has a subfolder. None: none.

    Raises
    ------
    OutputError
        An output cannot be written to `files`, or belongs to two sources.
    """
    several = len(sources) > 1
    is_file = out is not None and not several and out.suffix.lower() in IMAGE_SUFFIXES

    def outputs_for(name: Path) -> Iterator[Output]:
        if out is not None:
            yield Output("image", out if is_file else out / name)
        if stages is not None:
            yield Output("stages", stages / name.with_suffix("") if several else stages)

    jobs = [ImageJob(source, tuple(outputs_for(name)), name) for source, name in sources.items()]
    outputs = [output for job in jobs for output in job.outputs]
    check_sinks(outputs, files, makes_folder=not is_file)
    return jobs


@dataclass(frozen=True, slots=True)
class ImageSearch:
    """Searches single images, with one detector and settings."""

    model: DetectorModel
    settings: Settings

    def detect(self, source: Path, image: Image) -> FrameResult:
        """Search an image, BGR uint8 `(H, W, 3)`; threads may call this at once.

        Each detection becomes a track, with ids from 1. `source` is the name of the image in
        messages. Raises `ImageError` if it cannot be searched.
        """
        frame = Frame(0, Fraction(0), Picture(image))
        height, width = image.shape[:2]
        with named_errors(source, ImageError):
            detector = self.model.for_video(width, height, [image])
            steps = make_steps(StepContext(self.settings, width, height))
            detections = detector.detect(detector.search(frame.picture, None))
            tracks = tuple(
                Track(number, detection.box, detection.score, "detected", detection.class_name)
                for number, detection in enumerate(detections, start=1)
            )
            result = FrameResult(source, frame, detections, tracks)
            for step in steps:
                if isinstance(step, ParallelStep):
                    step.prepare(frame)
                result = step.apply(result)
        classes, found = self.settings.classes, result.detections
        rows = [row for row, name in enumerate(found.class_names) if is_chosen(name, classes)]
        return replace(result.of_classes(classes), detections=found[rows])

    def stage_images(self, image: Image, detections: Boxes) -> dict[str, Image]:
        """Return an image of each stage of the detector by its name, in order."""
        detector = self.model.for_video(image.shape[1], image.shape[0], [image])
        return stage_images_of(detector)(image, detections)


def run_images(
    jobs: Sequence[ImageJob],
    shared: Sequence[Output],
    search: ImageSearch,
    files: OutputFiles,
    *,
    threads: int = 1,
) -> Generator[FrameResult | ImageError]:
    """Search images; yield the result of each, or the error that prevented it.

    `threads` images are read and searched at once. The `shared` outputs receive all results in
    order. All outputs appear together, after the last result, which closes `files`.

    Raises
    ------
    OutputError
        An output cannot be written.
    """

    def detect(job: ImageJob) -> FrameResult | ImageError:
        try:
            return search.detect(job.source, read_image(job.source))
        except ImageError as error:
            return error

    folders = _common_folders(jobs)
    context = SinkContext(
        files,
        search.settings,
        places={job.source: job.name for job in jobs if job.name},
        stage_images=search.stage_images,
    )
    with files, open_sinks(shared, context) as shared_sinks, SearchThreads(threads) as pool:
        for job, result in pool.map_ordered(detect, jobs):
            if isinstance(result, FrameResult):
                for folder in folders:
                    files.stage_folder(folder)
                with open_sinks(job.outputs, context) as sinks:
                    sinks.write(result)
                    shared_sinks.write(result)
            yield result
        for warning in warnings_of(search.model):
            _log.warning("%s", warning)


def _common_folders(jobs: Sequence[ImageJob]) -> list[Path]:
    """Return the folder that has all outputs of each sink, of several images."""
    parents: dict[str, list[Path]] = {}
    for output in (output for job in jobs for output in job.outputs):
        parents.setdefault(output.sink, []).append(output.path.parent)
    return [Path(os.path.commonpath(paths)) for paths in parents.values() if len(paths) > 1]

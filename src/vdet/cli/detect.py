"""`vdet detect-image` and `vdet detect-video`: find vehicles in images, in one video or in many."""

import re
import shlex
from collections.abc import Sequence
from contextlib import closing
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vdet.cli import options
from vdet.cli.command import LOG, announce, announce_notes, command, print_lines, progress_bars
from vdet.errors import DOUBTFUL, ImageError, OutputError, failure_code, quantity
from vdet.files import OutputFiles, file_ids
from vdet.run.sinks import Output
from vdet.workers import DaskCluster, LocalProcesses, Workers, core_count

if TYPE_CHECKING:
    from vdet.batch import ManifestRecord
    from vdet.run.steps import FrameResult
    from vdet.run.video import Run

STAGE_MARGIN = Fraction(2)
"""Seconds to process before and after `--at`, for detector and tracker."""
_VIDEO_OR_NONE = "pass either OUT or --no-video; for several videos, add -d DIR"
_ENDING = re.compile(r"(\.[a-z0-9_-]+)+", re.ASCII)
"""The ending of an output's name, such as `.csv` or `.cars.csv`."""


@command()
@click.argument("images", nargs=-1, required=True, type=options.PATH, metavar="IMAGE...")
@options.output_file(
    "-o",
    "--output",
    metavar="PATH",
    help="Write the image with its boxes. For several images, a folder, in which they keep their "
    "names and folders.",
)
@options.output_folder("--stages", help="Write an image of every stage into DIR.")
@options.output_files("--json", help="Write the boxes to FILE. With -, to standard output.")
@options.output_files(
    "--labels", help="Write the boxes for labelling tools: .coco.json. Can be repeated."
)
@options.sinks_option
@options.classes_option
@options.lanes_option
@options.model_option
@options.settings_options
@options.overwrite_option
def detect_image(
    images: options.Paths,
    output: Path | None,
    stages: Path | None,
    sinks: tuple[Output, ...],
    source: options.SettingsSource,
    overwrite: bool,
    **paths: options.Paths,
) -> int:
    """Find vehicles in images.

    Each IMAGE is a file, or a folder (searched recursively). Without an output option, prints the
    vehicles: class, score, and box in pixels as x, y, width and height.

    \b
    Examples:
      vdet detect-image road.jpg -o found.jpg --json -
      vdet detect-image images/ -o found/ --labels images.coco.json
      vdet detect-image road.jpg --stages stages
    """
    settings = source.load()
    if settings.lack_of_metres:
        announce(f"vdet: note: {settings.lack_of_metres}")
    from vdet.detect.detectors import load_detector
    from vdet.run.images import ImageSearch, find_images, plan_images, run_images
    from vdet.run.sinks.protocol import STANDARD_OUTPUT, check_sinks

    search = ImageSearch(load_detector(settings.detector), settings)
    paths_below = find_images(images)
    outputs = options.requested_outputs(sinks, paths)
    inputs = source.inputs(*paths_below, settings=settings)
    files = OutputFiles(overwrite=overwrite, inputs=inputs, is_last=True)
    check_sinks(outputs, files)
    jobs = plan_images(paths_below, output, stages, files)
    is_printed = not (output or stages or outputs)
    failed = 0
    results = run_images(jobs, outputs, search, files, threads=core_count())
    with progress_bars(" images") as progress, closing(results):
        advance = progress("", len(jobs))
        for result in results:
            if isinstance(result, ImageError):
                LOG.error("%s", result)
                failed += 1
            elif is_printed:
                _print_vehicles(result)
            advance(1)
    if failed < len(jobs):
        written = (output, stages, *(item.path for item in outputs if item.path != STANDARD_OUTPUT))
        announce(*(f"{path}: written" for path in written if path))
    return failure_code(failed, len(jobs))


def _print_vehicles(result: "FrameResult") -> None:
    rows = []
    for track in result.tracks:
        box = ", ".join(map(str, track.box.xywh))
        rows.append(f"  {track.class_name or 'vehicle':8} {track.score:.2f}  {box}")
    print_lines(f"{result.source}: {quantity(len(rows), 'vehicle')}", *rows)


@command()
@click.argument("videos", nargs=-1, required=True, type=options.PATH, metavar="IN [OUT] | CLIP...")
@click.option("--no-video", is_flag=True, help="Do not write a video, only other outputs.")
@options.output_files(
    "--tracks",
    help="Write the boxes of every frame: .txt (MOTChallenge), .csv, .jsonl or .coco.json. With "
    "-, write .jsonl to standard output. Can be repeated.",
)
@options.output_files("--vehicles", help="Write a record of each vehicle: .csv, .json or .parquet.")
@options.output_folders("--crops", help="Write the best image of each vehicle into DIR.")
@options.output_folders("--page", help="Write a report about the vehicles, page.html, into DIR.")
@options.output_folders(
    "--review", help="Write a page for checking the counts, review.html, into DIR."
)
@options.output_folders(
    "--clips",
    help="Write a clip of each time span with vehicles into DIR. With lines or zones, only counted "
    "vehicles have clips.",
)
@options.setting_option(
    "clips.margin", "--margin", type=float, metavar="SECONDS", help="Time added around each clip"
)
@options.setting_option(
    "clips.exact", "--exact", is_flag=True, help="Cut clips at exact frames, by encoding again"
)
@options.counts_option
@options.flows_option
@options.interval_option
@options.corrections_option
@options.sinks_option
@options.output_folders(
    "--stages", help="Write an image of every stage of one frame into DIR. Requires --at."
)
@options.time_option("--at", help="Time of the frame for --stages.")
@options.classes_option
@options.overwrite_option
@options.start_option
@options.end_option
@options.number_option("--frames", help="Process at most N frames.")
@options.setting_option(
    "detector.stride",
    "--stride",
    type=click.IntRange(1, 100),
    metavar="N",
    help="Search every N-th frame",
)
@options.begin_option
@options.strict_option
@options.output_folder(
    "-d", "--directory", "folder", help="Process every CLIP, and write the outputs into DIR."
)
@click.option(
    "--skip-existing", is_flag=True, help="With -d: skip videos whose outputs are all up to date."
)
@options.number_option(
    "--threads",
    type=options.PROCESSES,
    show_default="one per core, shared by --jobs",
    help="Search one video in N threads.",
)
@options.jobs_option(help="With -d: process N videos at once.")
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="With -d: use this Dask scheduler, such as tcp://host:8786.",
)
@options.lanes_option
@options.model_option
@options.settings_options
def detect_video(
    videos: options.Paths,
    no_video: bool,
    corrections: options.Paths,
    sinks: tuple[Output, ...],
    at: Fraction | None,
    overwrite: bool,
    start: Fraction | None,
    end: Fraction | None,
    frames: int | None,
    strict: bool,
    folder: Path | None,
    skip_existing: bool,
    threads: int | None,
    jobs: int | None,
    scheduler: str | None,
    source: options.SettingsSource,
    **paths: options.Paths,
) -> int:
    """Find and follow vehicles in one video or many.

    IN is a video. OUT is a copy of it with a box around each vehicle. Without any output, OUT is
    beside IN, named in.vdet.mp4.

    With -d DIR, every CLIP is processed. A CLIP is a video, or a folder (searched recursively). The
    outputs go into DIR, with a record of each video in manifest.jsonl. Options such as --tracks
    then take only the ending of the names, such as .csv, or .crops for a folder.

    \b
    Examples:
      vdet detect-video in.mp4
      vdet detect-video in.mp4 out.mp4 --tracks out.csv
      vdet detect-video in.mp4 --no-video --tracks - --start 1:30 --end 2:00
      vdet detect-video in.mp4 --no-video --stages stages --at 12.5
      vdet detect-video in.mp4 --no-video -c gate.yaml --flows flows.csv --interval 15min
      vdet detect-video clips/ -d found --tracks .jsonl --skip-existing
    """
    outputs = options.requested_outputs(sinks, paths)
    has_stages = any(output.sink == "stages" for output in outputs)
    is_empty = start is not None and end is not None and end <= start
    mistakes = {
        "--stages and --at must be used together": has_stages != (at is not None),
        "--end must be later than --start": is_empty,
        "--overwrite and --skip-existing cannot be used together": overwrite and skip_existing,
        "--jobs and --scheduler cannot be used together": jobs and scheduler,
        "--jobs, --skip-existing and --scheduler require -d": not folder
        and (jobs or skip_existing or scheduler),
        "--corrections is for one video, without -d; for several use vdet count": folder
        and corrections,
        _VIDEO_OR_NONE: not folder and no_video and len(videos) > 1,
        "no output; add one, such as --tracks": no_video and not outputs,
    }
    for mistake, is_made in mistakes.items():
        if is_made:
            raise click.UsageError(mistake)
    if folder:
        outputs = [_checked_ending(output) for output in outputs]
    if not (no_video or (folder and any(output.sink == "video" for output in outputs))):
        drawn = Path() if folder else _drawn_video(videos, is_only=not outputs)
        outputs.insert(0, Output("video", drawn))
    settings = source.load()
    options.check_counting(settings, outputs, several=folder is not None)
    if settings.lack_of_metres and "lane-geometry" not in settings.conditions.ignore:
        announce(f"vdet: note: {settings.lack_of_metres}")
    from vdet.run.video import Run

    if at is not None and all(output.sink == "stages" for output in outputs):
        start, end = max(at - STAGE_MARGIN, start or Fraction(0)), end or at + STAGE_MARGIN
    run = Run(
        source=videos[0],
        outputs=tuple(outputs),
        settings=settings,
        start=start,
        end=end,
        frames=frames,
        at=at or Fraction(0),
        overwrite=overwrite,
        threads=threads,
        settings_files=source.files,
        corrections=corrections,
    )
    if folder is None:
        code, is_doubtful = 0, _process_video(run)
    else:
        code, is_doubtful = _process_videos(videos, folder, run, skip_existing, jobs, scheduler)
    return code or (DOUBTFUL if strict and is_doubtful else 0)


def _drawn_video(paths: Sequence[Path], *, is_only: bool) -> Path:
    """Return the video to write for `paths`, which are IN and OUT, or only IN.

    If it is the only output, it may be beside its source. Raises `click.UsageError`.
    """
    source, *videos = paths
    if not videos:
        is_pattern = "%" in source.name and not source.exists()
        if not is_only or source.is_dir() or is_pattern:
            raise click.UsageError(_VIDEO_OR_NONE)
        videos = [_beside(source)]
    from vdet.media.writer import may_replace_video

    if len(videos) > 1 or (videos[0].is_file() and not may_replace_video(videos[0])):
        if file_ids([source]) & file_ids(videos):
            raise OutputError(f"{videos[0]}: is an input of this run; use another output")
        shown = shlex.join(map(str, paths[:2])) + (" …" if len(paths) > 2 else "")
        raise click.UsageError(
            f"{videos[0]} would be replaced, but vdet did not write it; use another name, or for "
            f"several videos a folder: vdet detect-video {shown} -d found"
        )
    return videos[0]


def _beside(source: Path) -> Path:
    """Return the name of the video that is written without any output option."""
    from vdet.batch import DRAWN
    from vdet.run.sinks.protocol import sink_kind

    return source.with_name(f"{source.stem}{DRAWN}{sink_kind('video').endings[0]}")


def _process_video(run: "Run") -> bool:
    """Process a video, and return whether the result is doubtful."""
    from vdet.findings import warnings_in
    from vdet.run.sinks.protocol import STANDARD_OUTPUT
    from vdet.run.steps import findings_in
    from vdet.run.video import run_video

    with progress_bars(" frames") as progress:
        progress("opening", None)
        totals = run_video(run, progress=progress, is_last=True)
    numbers = f"{quantity(totals.frames, 'frame')}, {quantity(totals.tracks, 'track')}"
    rate = totals.frames / totals.seconds
    announce(f"{run.source}: {numbers}, {totals.seconds:.1f} s, {rate:.1f} frames/s")
    paths = [output.path for output in run.outputs if output.path != STANDARD_OUTPUT]
    announce(*(f"{path}: written" for path in paths))
    if totals.clock and run.settings.traffic:
        announce(f"{run.source}: begins {totals.clock}")
    if totals.corrected:
        announce(f"{run.source}: {totals.corrected}")
    findings = findings_in(totals.facts)
    announce_notes(run.source, findings.items)
    return bool(warnings_in(findings.items))


def _process_videos(
    clips: Sequence[Path],
    folder: Path,
    common: "Run",
    skip_existing: bool,
    jobs: int | None,
    scheduler: str | None,
) -> tuple[int, bool]:
    """Process the videos of `clips`; arguments as in `make_plan` and in `detect_video`.

    Returns
    -------
    The exit code, and whether a result is doubtful.
    """
    from vdet.batch import make_plan, run_batch

    if scheduler:  # the workers were started in other folders
        clips, folder = [clip.absolute() for clip in clips], folder.absolute()
    plan = make_plan(clips, folder, common, skip_existing=skip_existing)
    cores = core_count()
    jobs = max(1, min(jobs or cores, len(plan.runs)))
    workers: Workers = LocalProcesses(jobs)
    if scheduler:
        workers, jobs = DaskCluster(scheduler), cores  # a thread for each file
    results = run_batch(plan, workers=workers, threads=max(1, cores // jobs))
    failed, is_doubtful, clocks = 0, plan.doubtful > 0, list[str]()
    with progress_bars(" files") as progress, closing(results):
        advance = progress("", len(plan.runs))
        for run, record in results:
            clocks += _print_result(run, record)
            failed += record.error is not None
            is_doubtful |= record.is_doubtful
            advance(1)
    if clocks:
        more = f" (and {quantity(len(clocks) - 1, 'more file')})" if len(clocks) > 1 else ""
        LOG.warning("%s%s", clocks[0], more)
    done, skipped = len(plan.runs) - failed, len(plan.skipped)
    doubtful = f" ({plan.doubtful} doubtful)" if plan.doubtful else ""
    also = f"{skipped} skipped{doubtful}, " if skipped else ""
    announce(f"{plan.folder}: {quantity(done, 'file')} done, {also}{failed} failed")
    return failure_code(failed, len(plan.runs) + skipped), is_doubtful


def _checked_ending(output: Output) -> Output:
    """Return an output whose path is the ending of names. Raises `click.UsageError`."""
    from vdet.run.sinks.protocol import sink_kind

    sink, kind, ending = output.sink, sink_kind(output.sink), str(output.path).lower()
    if kind.takes == "images" or sink == "stages":
        raise click.UsageError(f"{sink}: cannot be written with -d; remove one of them")
    if not _ENDING.fullmatch(ending) or not kind.takes_name(f"video{ending}"):
        allowed = ", ".join(kind.endings) or f"as in .{sink if kind.folder_pattern else 'txt'}"
        raise click.UsageError(f"{sink}: with -d, pass only the ending of the names: {allowed}")
    return Output(sink, Path(ending))


def _print_result(run: "Run", record: "ManifestRecord") -> list[str]:
    """Print what a record says, and return its warnings about the clock, for one of all files."""
    from vdet.traffic.clock import OVERRIDE

    clocks = [warning for warning in record.warnings if warning.endswith(OVERRIDE)]
    for warning in record.warnings:
        if warning not in clocks:
            LOG.warning("%s", warning)
    if record.error:
        LOG.error("%s", record.error)
        return clocks
    numbers = f"{quantity(record.frames or 0, 'frame')}, {quantity(record.tracks or 0, 'track')}"
    begin = f", begins {record.begin}" if record.begin and run.settings.traffic else ""
    announce(f"{run.source}: {numbers}, {record.seconds:.1f} s{begin}")
    return clocks

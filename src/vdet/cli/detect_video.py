"""`vdet detect-video`: vehicles followed through a video, or through many."""

from fractions import Fraction
from pathlib import Path

import click

from vdet.cli.batch import BatchOptions, Work, batch_options, do_batch, wishes_of
from vdet.cli.options import (
    PathOf,
    Time,
    find_model,
    lane_options,
    model_option,
    overwrite_option,
    read_lanes,
    read_model,
    read_settings,
    settings_options,
)
from vdet.cli.progress import progress_bar
from vdet.pipeline.run import VideoJob, check_job, process_video


@click.command()
@click.argument("clips", nargs=-1, required=True, type=PathOf(), metavar="IN [OUT] | CLIP...")
@click.option("--no-video", is_flag=True, help="Write no video, only --tracks or --stages.")
@click.option(
    "--tracks",
    type=PathOf(),
    metavar="FILE",
    help="Every shown box: .txt (MOT), .csv or .jsonl; with -d only such a suffix.",
)
@click.option("--start", type=Time(), help="From this time on: seconds or HH:MM:SS.")
@click.option("--end", type=Time(), help="Up to this time.")
@click.option("--frames", type=click.IntRange(min=1), help="At most so many frames.")
@click.option(
    "--threads",
    type=click.IntRange(min=1),
    help="Of the search of a video; else one a core, shared by --jobs.",
)
@click.option("--stages", type=PathOf(), metavar="DIR", help="A picture of every stage …")
@click.option("--at", type=Time(), help="… of the frame at this time.")
@batch_options
@lane_options
@model_option
@settings_options
@overwrite_option
@click.pass_obj
def detect_video(
    quiet: bool,
    *,
    clips: tuple[Path, ...],
    no_video: bool,
    tracks: Path | None,
    start: Fraction | None,
    end: Fraction | None,
    frames: int | None,
    threads: int | None,
    stages: Path | None,
    at: Fraction | None,
    lanes: bool,
    camera_path: Path | None,
    model_path: Path | None,
    config_name: str | None,
    assignments: tuple[str, ...],
    overwrite: bool,
    folder: Path | None,
    jobs: int | None,
    skip_existing: bool,
    dry_run: bool,
    scheduler: str | None,
) -> int:
    """Find and follow vehicles in the video IN, and write it with their boxes to OUT.

    With -d DIR: in every CLIP, a file, a folder with all below it, or a quoted pattern like
    'day*/*.mp4'. DIR then holds a video for each of them, and manifest.jsonl with a record of each.
    """
    batch = BatchOptions(folder, jobs, skip_existing, dry_run, scheduler)
    if start is not None and end is not None and end <= start:
        raise click.UsageError("--end must be later than --start")
    if folder is None:
        wishes = None
        source, output = _in_and_out(clips, batch)
        _check_usage(output, no_video=no_video, tracks=tracks, stages=stages, at=at)
    else:
        if stages is not None or at is not None:
            raise click.UsageError("--stages and --at are for one video; leave out -d")
        wishes = wishes_of(batch, no_video=no_video, tracks=tracks, overwrite=overwrite)
        source, output, tracks = Path(), None, None  # each file has its own
    request = read_lanes(lanes, camera_path)
    loaded = read_settings(config_name, assignments)
    path = find_model(model_path, loaded)
    work = Work(read_model(path, loaded), path, loaded.settings, threads)
    moment = at or Fraction(0)
    job = VideoJob(source, output, tracks, start, end, frames, stages, moment, request)
    if wishes is not None:
        return do_batch(clips, job, wishes, batch, work, quiet=quiet)
    check_job(job, overwrite=overwrite)
    _do_one(job, work, quiet=quiet)
    return 0


def _in_and_out(clips: tuple[Path, ...], batch: BatchOptions) -> tuple[Path, Path | None]:
    if batch.any_but_folder:
        raise click.UsageError("--jobs, --skip-existing, --dry-run and --scheduler go with -d DIR")
    if len(clips) > 2:
        raise click.UsageError("give IN and OUT, or -d DIR for several videos")
    source, *outputs = clips
    return source, outputs[0] if outputs else None


def _check_usage(
    output: Path | None,
    *,
    no_video: bool,
    tracks: Path | None,
    stages: Path | None,
    at: Fraction | None,
) -> None:
    if no_video == (output is not None):
        raise click.UsageError("give OUT, or --no-video without OUT; or -d DIR for several videos")
    if output is None and tracks is None and stages is None:
        raise click.UsageError("nothing would be written; give OUT, --tracks or --stages")
    if (stages is None) != (at is None):
        raise click.UsageError("--stages and --at go together")


def _do_one(job: VideoJob, work: Work, *, quiet: bool) -> None:
    with progress_bar(" frames", quiet=quiet) as progress:
        summary = process_video(
            job, work.model, work.settings, threads=work.threads, progress=progress
        )
    if not quiet:
        rate = summary.frames / summary.seconds
        click.echo(
            f"{job.source}: {summary.frames} frames, {summary.tracks} vehicles, "
            f"{summary.seconds:.1f} s, {rate:.1f} frames/s",
            err=True,
        )

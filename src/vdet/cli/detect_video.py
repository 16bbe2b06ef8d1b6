"""`vdet detect-video`: vehicles followed through a video."""

from fractions import Fraction
from pathlib import Path

import click

from vdet.cli.options import (
    PathOf,
    Time,
    lane_options,
    model_option,
    overwrite_option,
    read_lanes,
    read_model,
    read_settings,
    settings_options,
)
from vdet.cli.progress import progress_bar
from vdet.pipeline import VideoJob, check_job, process_video


@click.command()
@click.argument("source", type=PathOf(), metavar="IN")
@click.argument("output", required=False, type=PathOf(), metavar="[OUT]")
@click.option("--no-video", is_flag=True, help="Write no video, only --tracks or --stages.")
@click.option(
    "--tracks", type=PathOf(), metavar="FILE", help="Every shown box: .txt (MOT), .csv or .jsonl."
)
@click.option("--start", type=Time(), help="From this time on: seconds or HH:MM:SS.")
@click.option("--end", type=Time(), help="Up to this time.")
@click.option("--frames", type=click.IntRange(min=1), help="At most so many frames.")
@click.option("--threads", type=click.IntRange(min=1), help="Of the search; else one a core.")
@click.option("--stages", type=PathOf(), metavar="DIR", help="A picture of every stage …")
@click.option("--at", type=Time(), help="… of the frame at this time.")
@lane_options
@model_option
@settings_options
@overwrite_option
@click.pass_obj
def detect_video(
    quiet: bool,
    *,
    source: Path,
    output: Path | None,
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
) -> None:
    """Find and follow vehicles in the video IN, and write it with their boxes to OUT."""
    if no_video == (output is not None):
        raise click.UsageError("give OUT, or --no-video without OUT")
    if output is None and tracks is None and stages is None:
        raise click.UsageError("nothing would be written; give OUT, --tracks or --stages")
    if (stages is None) != (at is None):
        raise click.UsageError("--stages and --at go together")
    if start is not None and end is not None and end <= start:
        raise click.UsageError("--end must be later than --start")
    request = read_lanes(lanes, camera_path)
    loaded = read_settings(config_name, assignments)
    model = read_model(model_path, loaded)
    moment = at or Fraction(0)
    job = VideoJob(source, output, tracks, start, end, frames, stages, moment, request)
    check_job(job, overwrite=overwrite)
    with progress_bar(" frames", quiet=quiet) as progress:
        summary = process_video(job, model, loaded.settings, threads=threads, progress=progress)
    if not quiet:
        rate = summary.frames / summary.seconds
        click.echo(
            f"{source}: {summary.frames} frames, {summary.tracks} vehicles, "
            f"{summary.seconds:.1f} s, {rate:.1f} frames/s",
            err=True,
        )

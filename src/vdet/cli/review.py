"""`vdet review`: the strips of lines, from a video and its saved tracks, and what was checked."""

from fractions import Fraction
from pathlib import Path

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import print_lines, progress_bars
from vdet.run.sinks import Output


@command()
@click.argument("source_path", type=options.PATH, metavar="IN")
@options.tracks_from_option(required=True)
@options.output_folder("-o", "--output", required=True, help="Folder for the page, review.html.")
@options.corrections_option
@options.start_option
@options.end_option
@options.settings_options()
@options.overwrite_option
def review(
    source_path: Path,
    output: Path,
    corrections: options.Paths,
    tracks: Path,
    start: Fraction | None,
    end: Fraction | None,
    source: options.SettingsSource,
    overwrite: bool,
) -> None:
    """Write a page for checking the counts of a video.

    IN is a video, read again but not searched. The page has a strip of each line, which shows
    everything that crossed it, with a mark for each counted vehicle. It saves corrections, and
    opens those of --corrections.

    \b
    Example:
      vdet review in.mp4 --tracks-from tracks.jsonl -c gate.yaml -o review
    """
    from vdet.run.video import Run, run_video

    source.check_for_tracks()
    settings = source.load()
    if not settings.traffic:
        raise click.UsageError("no lines or zones to review; add a settings file with -c FILE")
    run = Run(
        source_path,
        outputs=(Output("review", output),),
        settings=settings,
        start=start,
        end=end,
        overwrite=overwrite,
        settings_files=(*source.files, tracks),
        corrections=corrections,
    )
    with progress_bars(" frames") as progress:
        run_video(run, tracks=tracks, progress=progress, is_last=True)
    print_lines(f"{output}: written")

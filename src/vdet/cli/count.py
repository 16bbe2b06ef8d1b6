"""`vdet count` and `vdet review`: counts of saved tracks, and the page of their review."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import click

from vdet.cli import options
from vdet.cli.command import LOG, announce, announce_notes, command, print_lines, progress_bars
from vdet.config.classes import STANDARD_CLASSES, standard_classes
from vdet.errors import DOUBTFUL, quantity
from vdet.files import OutputFiles, output_errors, write_text
from vdet.run.sinks import Output

if TYPE_CHECKING:
    from vdet.boxes import Image
    from vdet.traffic.counts import Counts, Estimate
    from vdet.traffic.survey import Survey


@command()
@click.argument("tracks", nargs=-1, required=True, type=options.PATH, metavar="TRACKS...")
@options.counts_option
@options.flows_option
@options.output_folders("--page", help="Write a page about all TRACKS, page.html, into DIR.")
@options.interval_option
@options.corrections_option
@options.begin_option
@click.option(
    "--size",
    type=options.parse_pair,
    metavar="WIDTHxHEIGHT",
    show_default="from TRACKS, else camera.size",
    help="Frame size of the video in pixels.",
)
@click.option(
    "--rate",
    type=click.FloatRange(min=0, min_open=True),
    metavar="FPS",
    show_default="from TRACKS",
    help="Frame rate of the video, for TRACKS without times.",
)
@click.option(
    "--class", "classes", metavar="NAME", multiple=True, help=f"{options.CLASS_HELP} (`classes`)."
)
@options.strict_option
@options.settings_options
@options.overwrite_option
def count(
    tracks: options.Paths,
    size: tuple[int, int] | None,
    rate: float | None,
    corrections: options.Paths,
    source: options.SettingsSource,
    overwrite: bool,
    classes: tuple[str, ...],
    strict: bool,
    **paths: options.Paths,
) -> int:
    """Count the vehicles of track files at lines and in zones.

    TRACKS are files of vdet detect-video --tracks, of one camera. Vehicles are not detected again,
    and the counts are the same as those of detect-video --counts. If the clock times of TRACKS
    follow one another, a vehicle in two of them counts once.

    \b
    Examples:
      vdet count tracks.jsonl -c gate.yaml
      vdet count tracks.jsonl -c gate.yaml --flows flows.csv --interval 15min
      vdet count day/*.jsonl -c gate.yaml --counts day.xlsx --page day
    """
    from vdet.batch import MANIFEST

    if len(tracks) > 1:  # by a pattern such as found/*.jsonl
        tracks = tuple(path for path in tracks if path.name != MANIFEST)
    source.check_for_tracks()
    settings = source.load()
    if classes:  # any class that TRACKS have
        settings = settings.model_copy(update={"classes": standard_classes(classes)})
    if not settings.traffic:
        raise click.UsageError("no lines or zones to count at; add a settings file with -c FILE")
    outputs = options.requested_outputs((), paths)
    from vdet.pages.traffic import survey_image
    from vdet.review.corrections import Corrections, apply_corrections
    from vdet.run.sinks.protocol import check_sinks
    from vdet.traffic.counting import count_files
    from vdet.traffic.survey import Survey

    inputs = source.inputs(*tracks, *corrections, settings=settings)
    files = OutputFiles(overwrite=overwrite, inputs=inputs, is_last=True)
    check_sinks(outputs, files)
    reviews, scene = list(map(Corrections.read, corrections)), survey_image(settings)
    with progress_bars(" files") as progress:
        advance = progress("", len(tracks) if len(tracks) > 1 else None)
        videos = count_files(
            tracks, settings, size, rate, with_all_classes=bool(reviews), advance=advance
        )
    videos = apply_corrections(videos, reviews, settings)
    for name, result in videos.items():
        if result.clock:
            announce(f"{name}: begins {result.clock}")
        for warning in result.warnings:
            LOG.warning("%s: %s", name, warning)
        announce_notes(name, result.findings)
    counted_classes = {event.class_name for result in videos.values() for event in result.events}
    for name in {*standard_classes(classes)} - {*counted_classes, *STANDARD_CLASSES}:
        LOG.warning("--class %s: no vehicle of this class was counted", name)
    survey = Survey(videos, settings)
    with files:
        for output in outputs:
            with output_errors(output.path):
                _write(output, files, survey, scene)
    print_lines(*_totals(videos), *_matrix(list(videos.values())))
    for name, result in videos.items():
        if result.corrected:
            print_lines(f"{name}: {result.corrected}")
    is_doubtful = any(result.warnings for result in videos.values())
    return DOUBTFUL if strict and is_doubtful else 0


def _write(output: "Output", files: OutputFiles, survey: "Survey", scene: "Image | None") -> None:
    """Write a table, a workbook or a page; `scene` is the picture of the settings."""
    from vdet.pages.render import PAGE_NAME
    from vdet.pages.traffic import counts_page, scene_picture
    from vdet.run.sinks.data import write_tables

    if scene is not None:
        scene = scene_picture(scene, survey.settings.traffic, survey.counts)
    if output.sink == "page":
        page = files.stage_folder(output.path) / PAGE_NAME
        return write_text(page, counts_page(survey, scene))
    return write_tables(survey, output.sink, output.path, files, scene)


def _totals(videos: "Mapping[str, Counts]") -> list[str]:
    """Return the totals of all files, and of each file if one has no clock."""
    from vdet.evaluate.results import table
    from vdet.traffic.counts import direction_totals

    totals = {}
    if len(videos) == 1 or not all(counts.clock for counts in videos.values()):
        totals = {name: counts.totals for name, counts in videos.items()}
    if len(videos) > 1:
        totals["all files"] = direction_totals(list(videos.values()))
    is_corrected = any(counts.corrected for counts in videos.values())
    rows = []
    for file, directions in totals.items():
        for total in directions:
            numbers = [str(total.count)]
            if is_corrected:
                numbers = [str(total.counted), str(total.count), _estimated(total.estimate)]
            classes = ", ".join(quantity(number, kind) for kind, number in total.classes.items())
            rows.append((file, total.name, total.direction, *numbers, classes))
    headings = ("counted", "corrected", "estimated (95 %)") if is_corrected else ("count",)
    return table(("file", "name", "direction", *headings, "classes"), rows)


def _estimated(estimate: "Estimate | None") -> str:
    """Return an estimate with its interval."""
    if estimate is None:
        return "-"
    return f"{estimate.true:.0f} ({estimate.low:.0f} to {estimate.high:.0f})"


def _matrix(videos: "Sequence[Counts]") -> list[str]:
    """Return the flows between lines and zones over all files; empty if there is only one."""
    from vdet.evaluate.results import table
    from vdet.traffic.output import flow_matrix

    matrix = flow_matrix(videos)
    if len(matrix) < 2:
        return []
    rows = [(name, *map(str, row.values())) for name, row in matrix.items()]
    return ["", *table(("from", *(f"to {name}" for name in matrix), "to none"), rows)]


@command()
@click.argument("source_path", type=options.PATH, metavar="IN")
@options.tracks_from_option(required=True)
@options.output_folder("-o", "--output", required=True, help="Folder for the page, review.html.")
@options.corrections_option
@options.start_option
@options.end_option
@options.settings_options
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

"""`vdet eval`: measure detection, tracking or counts."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from vdet.cli import options
from vdet.cli.command import command, progress_bars
from vdet.cli.options import ResultFiles, SettingsSource, facts_options, results_options
from vdet.workers import core_count

if TYPE_CHECKING:
    from vdet.config.schema import Settings
    from vdet.evaluate.results import RunName


@command()
@click.argument("data", nargs=-1, required=True, type=options.PATH, metavar="DATA...")
@click.option(
    "--min-width",
    type=click.FloatRange(0, 1),
    metavar="FRACTION",
    default=0.0,
    help="Ignore vehicles narrower than this fraction of the image width, 0 to 1.",
)
@options.model_option
@options.settings_options
@results_options
def images(
    data: options.Paths, min_width: float, source: SettingsSource, results: ResultFiles
) -> None:
    """Measure detection in labelled images.

    Each DATA is a folder in COCO or YOLO format, or a COCO file. Each image is searched on
    its own and compared with its labels.

    \b
    Examples:
      vdet eval images city/ motorway/ --model their.onnx --min-width 0.03
    """
    settings = source.load()
    options.reject_regions(settings)
    from vdet.detect.detectors import load_detector
    from vdet.evaluate.results import Counting, evaluate_images, images_report
    from vdet.labels.reading import Roles, read_labelled_images

    detector = load_detector(settings.detector.showing_all())
    roles = Roles.from_settings(settings)
    sets = [read_labelled_images(path, roles) for path in data]
    images_read = (image.path for labelled in sets for image in labelled.images)
    results.check(source.inputs(*data, *images_read, settings=settings))
    shown = settings.detector
    counting = Counting(shown.min_score_still, min_width, shown.class_minima)
    with progress_bars(" images") as progress:
        scores = evaluate_images(sets, detector, counting, threads=core_count(), progress=progress)
    results.print_report(images_report(scores, counting, _run_name(settings, source)))


@command()
@click.argument("prediction", type=options.PATH, metavar="PRED")
@click.argument("truth", type=options.PATH, metavar="TRUTH")
@options.until_option
@options.settings_options
@results_options
def tracks(
    prediction: Path, truth: Path, until: int | None, source: SettingsSource, results: ResultFiles
) -> None:
    """Compare a file of tracks with the ground truth.

    PRED is a file of vdet detect-video --tracks. TRUTH is a MOTChallenge gt.txt, COCO with
    tracks, or a .csv or .jsonl of vdet.

    \b
    Examples:
      vdet eval tracks out.txt gt.txt --page page
    """
    from vdet.evaluate.results import score_files, tracks_report

    results.check(source.inputs(prediction, truth))
    settings = source.load()
    options.reject_regions(settings)
    with progress_bars("") as progress:
        progress("comparing", None)
        score = score_files(prediction, truth, until, settings)
    results.print_report(tracks_report(score, truth))


@command()
@click.argument("videos", nargs=-1, required=True, type=options.PATH, metavar="IN...")
@options.truths_option
@options.until_option
@options.model_option
@options.settings_options
@results_options
def video(
    videos: options.Paths,
    truths: options.Paths,
    until: int | None,
    source: SettingsSource,
    results: ResultFiles,
) -> None:
    """Measure detection and tracking in labelled video.

    Tracks the vehicles in each video IN, and compares them with its ground truth. Vehicles outside
    the regions of the settings do not count.

    \b
    Examples:
      vdet eval video in.mp4 --truth gt.txt --set tracker.confirm_seconds=0.3
    """
    labelled = options.with_truths(videos, truths)
    settings = source.load()
    from vdet.detect.detectors import load_detector
    from vdet.evaluate.results import evaluate_video, video_report
    from vdet.labels.reading import Roles, read_truth

    detector = load_detector(settings.detector)
    results.check(source.inputs(*videos, *truths, settings=settings))
    roles = Roles.from_settings(settings)
    pairs = [(path, read_truth(truth, roles)) for path, truth in labelled]
    with progress_bars(" frames") as progress:
        scores = [
            evaluate_video(path, truth, settings, detector, progress=progress, until=until)
            for path, truth in pairs
        ]
    results.print_report(video_report(scores, _run_name(settings, source)))


@command()
@click.argument("events", type=options.PATH, metavar="OUT")
@click.argument("truth", type=options.PATH, metavar="CORRECTIONS")
@facts_options
def counts(events: Path, truth: Path, results: ResultFiles) -> None:
    """Measure counts in the minutes that a reviewer has checked.

    OUT is the table of events, .csv, that --counts wrote for the same video, also with other
    settings or another network. CORRECTIONS is the file that the page of vdet review saved.

    \b
    Examples:
      vdet eval counts counts.csv corrections.yaml
    """
    from vdet.evaluate.counts import count_lines, score_counts
    from vdet.review.corrections import Corrections
    from vdet.run.images import input_files

    results.check(input_files(events, truth))
    scores = score_counts(events, Corrections.read(truth))
    results.print(count_lines(scores), {"counts": [score.record for score in scores]})


def _run_name(settings: "Settings", source: SettingsSource) -> "RunName":
    """Return a description of the detector that is measured."""
    from vdet.detect.detectors import model_file
    from vdet.evaluate.results import RunName

    detector, configs = settings.detector, " ".join(source.configs) or None
    return RunName(detector.kind, model_file(detector), configs, source.changes)


_HELP = "Measure detection, tracking or counts."
eval_group = click.Group("eval", [counts, images, tracks, video], help=_HELP)

"""`vdet eval`: measure detection, tracking or the classifier."""

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import progress_steps
from vdet.cli.results import ResultFiles, facts_options, results_options
from vdet.workers import IMAGES, core_count, return_freed_memory

_data = click.argument("data", nargs=-1, required=True, type=options.INPUT, metavar="DATA...")


@command()
@_data
@options.option("--min-width FRACTION", click.FloatRange(0, 1), default=0.0)
@options.settings_options("detector.min_score_still=0.5", options.model_option)
@results_options
def images(data: tuple[Path, ...], min_width: float, **targets: Any) -> None:
    """Measure detection in labelled images.

    Each DATA is a folder in COCO, KITTI or YOLO format, or a COCO file. Each image is searched on
    its own and compared with its labels.

    Parameters
    ----------
    min_width
        Ignore vehicles narrower than this fraction of the image width, 0 to 1.

    Examples
    --------
    vdet eval images city/ motorway/ --model their.onnx --min-width 0.03
    """
    settings = options.read_for_whole_frames()
    from vdet.detect.factory import load_detector
    from vdet.evaluate.images import Counting, evaluate_images
    from vdet.evaluate.report import images_report
    from vdet.labels.reading import read_labelled_images
    from vdet.labels.roles import Roles

    return_freed_memory(*IMAGES)
    detector, roles = settings.detector, Roles.from_settings(settings)
    model = load_detector(detector.showing_all())
    sets = [read_labelled_images(path, roles) for path in data]
    results = ResultFiles(**targets).checked()
    counting = Counting(detector.min_score_still, min_width)
    with progress_steps(" images") as steps:
        progress = partial(steps, "")
        result = evaluate_images(sets, model, counting, threads=core_count(), progress=progress)
    results.print_report(images_report(result, options.run_name(settings)))


_ON_LAST = "leak-free: a new model is tested on the last patches of each folder"
_ON_ALL = "if the model was trained on some of these patches, the scores are too good"


@command()
@_data
@options.settings_options("train.svm.C=1e-4", options.model_option)
@facts_options
def patches(data: tuple[Path, ...], **targets: Any) -> None:
    """Measure the classifier on labelled patches.

    Each DATA is a folder or a zip file, as for vdet train. With --model, that model is tested on
    all of DATA. Otherwise a new model is trained, and tested on the last patches of each folder.

    Examples
    --------
    vdet eval patches vehicles.zip non-vehicles.zip --json scores.json
    """
    settings = options.read_settings(detector="svm")
    from vdet.detect.svm.detector import requested_features
    from vdet.detect.svm.model import load_model
    from vdet.learn.svm.dataset import find_patches
    from vdet.learn.svm.training import evaluate_patches

    path = Path(settings.svm.model) if settings.svm.model else None
    model = load_model(path, requested_features(settings.svm)) if path else None
    results = ResultFiles(**targets).checked()
    files = find_patches(data)
    with progress_steps("") as steps:
        result = evaluate_patches(files, settings, model, steps=steps)
    name = options.run_name(settings)
    meaning = _ON_ALL if model else _ON_LAST
    values = name.values | {"meaning": meaning, "test": asdict(result)}
    results.print([name.line, meaning, "", *result.lines()], values)


@command()
@click.argument("prediction", type=options.INPUT, metavar="PRED")
@click.argument("truth", type=options.INPUT, metavar="TRUTH")
@options.until_option
@options.settings_options("labels.roles.tram=vehicle")
@results_options
def tracks(prediction: Path, truth: Path, until: int | None, **targets: Any) -> None:
    """Compare a file of tracks with the ground truth.

    PRED is a file of vdet detect-video --tracks. TRUTH is a MOTChallenge gt.txt, COCO with
    tracks, or a .csv or .jsonl of vdet.

    Examples
    --------
    vdet eval tracks out.txt gt.txt --page page
    """
    from vdet.evaluate.report import tracks_report
    from vdet.evaluate.video import score_files

    results = ResultFiles(**targets).checked()
    with progress_steps("") as steps:
        steps("comparing", None)
        result = score_files(prediction, truth, until, options.read_settings())
    results.print_report(tracks_report(result, truth))


@command()
@click.argument("videos", nargs=-1, required=True, type=options.INPUT, metavar="IN...")
@options.truth_option
@options.until_option
@options.settings_options("tracker.confirm_seconds=0.3", options.model_option)
@results_options
def video(
    videos: tuple[Path, ...], truths: tuple[Path, ...], until: int | None, **targets: Any
) -> None:
    """Measure detection and tracking in labelled video.

    Tracks the vehicles in each video IN, and compares them with its ground truth. Vehicles outside
    the regions of the settings do not count.

    Examples
    --------
    vdet eval video in.mp4 --truth gt.txt --set tracker.confirm_seconds=0.3
    """
    pairs = options.paired(videos, truths)
    settings = options.read_settings()
    from vdet.detect.factory import load_detector
    from vdet.evaluate.report import video_report
    from vdet.evaluate.video import evaluate_clip, open_clip
    from vdet.regions import check_masks

    check_masks(settings.regions)
    model = load_detector(settings.detector)
    results = ResultFiles(**targets).checked()
    clips = [open_clip(*pair, until, settings) for pair in pairs]
    with progress_steps(" frames") as steps:
        found = [evaluate_clip(clip, settings, model, partial(steps, "")) for clip in clips]
    results.print_report(video_report(found, options.run_name(settings)))


_HELP = "Measure detection, tracking or the classifier."
eval_group = click.Group("eval", [images, patches, tracks, video], help=_HELP, short_help=_HELP)

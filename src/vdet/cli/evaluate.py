"""`vdet eval`: measure detection, tracking or the classifier."""

import itertools
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import progress_steps
from vdet.cli.results import Results, facts_options, results_options
from vdet.errors import ConfigError


@command(
    "vdet eval images pictures/",
    "vdet eval images city/ motorway/ --model their.onnx --least-width 0.03",
)
@click.argument("data", nargs=-1, required=True, type=options.INPUT, metavar="DATA...")
@options.option(
    "--score SCORE",
    "Count boxes with at least this score, 0 to 1.",
    options.SHARE,
    show_default="what vdet detect-image shows",
)
@options.option(
    "--least-width SHARE",
    "Ignore vehicles narrower than this share of the picture's width, 0 to 1.",
    options.SHARE,
    default=0.0,
)
@options.settings_options("detector.still_score=0.5", options.model_option)
@results_options
def images(
    data: tuple[Path, ...],
    score: float | None,
    least_width: float,
    choice: options.SettingsChoice,
    results: Results,
) -> None:
    """Measure detection in labelled pictures.

    Each DATA is a folder in COCO, KITTI, YOLO or Pascal VOC form, or a COCO file. Each picture is
    searched on its own, and compared with its labels.
    """
    settings = choice.read_for_whole_frames()
    detector = settings.detector
    from vdet.detect.factory import load_detector
    from vdet.evaluate.images import Counting, evaluate_images
    from vdet.evaluate.output import RunName
    from vdet.evaluate.report import images_report
    from vdet.labels.reading import read_labelled_pictures
    from vdet.labels.roles import Roles
    from vdet.workers import PICTURES, core_count, return_freed_memory

    return_freed_memory(*PICTURES)
    model = load_detector(detector.showing_all())
    roles = Roles.from_settings(settings)
    sets = [read_labelled_pictures(path, roles) for path in data]
    results.check()
    counting = Counting(detector.shown_score if score is None else score, least_width)
    with progress_steps(" pictures") as steps:
        progress = partial(steps, "")
        result = evaluate_images(sets, model, counting, threads=core_count(), progress=progress)
    run = RunName.of(detector, choice.name, choice.assignments)
    results.print(*images_report(result, run))


_ON_LAST = "leak-free: a new model is tested on the last patches of each folder"
_ON_ALL = "if the model was trained on some of these patches, the scores are too good"


@command(
    "vdet eval patches vehicles.zip non-vehicles.zip --json scores.json",
    "vdet eval patches patches/ --model model.npz",
)
@click.argument("data", nargs=-1, required=True, type=options.INPUT, metavar="DATA...")
@options.short_form(
    "--model FILE",
    "detector.model",
    "Test this model on all of DATA. Without one, a new model is tested on the last patches of "
    "each folder.",
)
@options.settings_options("train.svm.C=1e-4")
@options.jobs_option("Describe patches in N threads.")
@facts_options
def patches(
    data: tuple[Path, ...],
    choice: options.SettingsChoice,
    jobs: int | None,
    results: Results,
) -> None:
    """Measure the classifier on labelled patches.

    Each DATA is a folder or a zip file, as vdet train takes it.
    """
    settings = choice.read(detector="svm")
    from vdet.detect.svm.kind import requested_features, trained_on
    from vdet.detect.svm.model import load_model
    from vdet.evaluate.output import RunName
    from vdet.learn.svm.dataset import find_patches
    from vdet.learn.svm.training import evaluate_patches

    model_path = Path(settings.svm.model) if settings.svm.model else None
    model = load_model(model_path, requested_features(settings.svm)) if model_path else None
    results.check()
    files = find_patches(data)
    with progress_steps("") as steps:
        result = evaluate_patches(files, settings, model, jobs=jobs, steps=steps)
    sources = trained_on(model_path) if model_path else ()
    name = RunName("svm", model_path, choice.name, choice.assignments, sources)
    meaning = _ON_ALL if model else _ON_LAST
    values = name.values() | {"meaning": meaning, "test": asdict(result)}
    results.print([*name.lines(), meaning, "", *result.lines()], values)


@command("vdet eval tracks out.txt gt.txt --page page")
@click.argument("prediction", type=options.INPUT, metavar="PRED")
@click.argument("truth", type=options.INPUT, metavar="TRUTH")
@options.until_option
@options.option(
    "--rate FPS",
    "Frames per second, for the number of false tracks per minute.",
    options.RATE,
    show_default="from the times in PRED",
)
@options.settings_options("labels.roles.motorcycle=vehicle")
@results_options
def tracks(
    prediction: Path,
    truth: Path,
    until: int | None,
    rate: float | None,
    choice: options.SettingsChoice,
    results: Results,
) -> None:
    """Compare a file of tracks with the truth.

    PRED is a file of vdet detect-video --tracks. TRUTH is MOTChallenge gt.txt, KITTI tracking
    labels, CVAT for video 1.1, COCO or YOLO with tracks, or a .csv or .jsonl of vdet.
    """
    from vdet.evaluate.report import tracks_report
    from vdet.evaluate.video import score_files
    from vdet.labels.roles import Roles

    roles = Roles.from_settings(choice.read())
    results.check()
    with progress_steps("") as steps:
        steps("comparing", None)
        run = score_files(prediction, truth, roles, until=until, rate=rate)
    results.print(*tracks_report(run, truth))


@command(
    "vdet eval video in.mp4 --truth gt.txt --page page",
    "vdet eval video in.mp4 --truth gt.txt --sweep tracker.needed=0.1,0.3",
)
@click.argument("videos", nargs=-1, required=True, type=options.INPUT, metavar="IN...")
@options.truth_option
@options.until_option
@options.option(
    "--sweep KEY=VALUE,VALUE",
    "Compare values of one setting, for example tracker.needed=0.1,0.3. Repeated, all "
    "combinations are compared.",
    name="sweeps",
    multiple=True,
)
@options.settings_options("tracker.needed=0.3", options.model_option)
@results_options
def video(
    videos: tuple[Path, ...],
    truths: tuple[Path, ...],
    until: int | None,
    sweeps: tuple[str, ...],
    choice: options.SettingsChoice,
    results: Results,
) -> None:
    """Measure detection and tracking in labelled video.

    Vehicles are found and followed in each video IN, and compared with its truth. Vehicles
    outside the regions of the settings do not count.
    """
    if len(videos) != len(truths):
        given = f"videos: {len(videos)}, truths: {len(truths)}"
        raise click.UsageError(f"give one --truth for each video ({given})")
    base = choice.read()
    from vdet.detect.factory import load_detector
    from vdet.evaluate.output import RunName
    from vdet.evaluate.report import video_report
    from vdet.evaluate.video import Variant, evaluate_clips, open_clip
    from vdet.labels.roles import Roles
    from vdet.regions import check_masks

    check_masks(base.regions)
    variants = []
    for extra in grid(sweeps):
        settings = choice.read(*extra)
        model = load_detector(settings.detector)
        variants.append(Variant(settings, model, extra))
    detectors = [variant.settings.detector for variant in variants]
    results.check()
    roles = Roles.from_settings(base)
    clips = [open_clip(*pair, until, roles) for pair in zip(videos, truths, strict=True)]
    with progress_steps(" frames") as steps:
        runs = evaluate_clips(clips, variants, partial(steps, ""))
    name = RunName.of(detectors[0], choice.name, choice.assignments)
    results.print(*video_report(runs, name))


def grid(sweeps: Sequence[str]) -> list[tuple[str, ...]]:
    """Return every combination of the values, each as assignments for `load_settings`.

    Parameters
    ----------
    sweeps
        `KEY=VALUE,VALUE…` each. A comma inside brackets belongs to its value.

    Returns
    -------
    The combinations in the order of the values; the last key changes fastest. A single empty
    combination if there are no sweeps.

    Raises
    ------
    ConfigError
        There is no `=`, a value is empty, or a key is swept twice.
    """
    axes: dict[str, list[str]] = {}
    for text in sweeps:
        key, equals, values = (part.strip() for part in text.partition("="))
        found = [value.strip() for value in _split(values)]
        if not (key and equals and all(found)):
            expected = "expected KEY=VALUE,VALUE, as in tracker.needed=0.1,0.2"
            raise ConfigError(f"--sweep {text}: {expected}")
        if key in axes:
            raise ConfigError(f"--sweep {key}: is given twice; put all its values in one")
        axes[key] = [f"{key}={value}" for value in dict.fromkeys(found)]
    return list(itertools.product(*axes.values()))


def _split(values: str) -> list[str]:
    """Split at the commas outside brackets."""
    parts, depth = [""], 0
    for letter in values:
        depth += (letter in "[{") - (letter in "]}")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return parts


_HELP = "Measure detection, tracking or the classifier."
eval_group = click.Group("eval", [images, patches, tracks, video], help=_HELP, short_help=_HELP)

"""`vdet mine`, `vdet train` and `vdet train-net`: from labelled data to models."""

from itertools import chain
from pathlib import Path
from statistics import fmean

import click

from vdet.cli import options
from vdet.cli.command import LOG, command, print_lines, progress_bar, progress_bars
from vdet.cli.options import Paths, SettingsSource
from vdet.errors import needing, quantity
from vdet.files import OutputFiles
from vdet.workers import limit_library_threads

_AVERAGED = 100
"""Number of steps whose mean loss is printed."""
_FEW_STEPS = 500
"""Number of steps below which a network from random weights finds nothing."""


@command()
@click.argument("data", nargs=-1, required=True, type=options.PATH, metavar="DATA...")
@options.output_file("-o", "--output", required=True, help="Model file to write, .npz.")
@options.settings_options
@options.jobs_option(help="Compute features in N threads.")
@options.overwrite_option
def train(
    data: Paths, output: Path, source: SettingsSource, jobs: int | None, overwrite: bool
) -> None:
    """Train a linear model on labelled patches.

    Each DATA is a folder or a zip file with images in vehicles/<group>/ and non-vehicles/<group>/.
    With the boxes.csv of vdet mine beside these folders, the model also learns to find the sides of
    vehicles.

    \b
    Examples:
      vdet train vehicles.zip non-vehicles.zip mined.zip -o model.npz
      vdet train patches/ -o model.npz --set train.svm.C=1e-3
    """
    settings = source.load(detector="svm")
    files = OutputFiles(overwrite=overwrite, inputs=source.inputs(*data))
    files.check(output, suffixes=(".npz",), noun="models")
    from vdet.detect.svm.model import save_model
    from vdet.learn.svm.patches import find_patches
    from vdet.learn.svm.training import train as fit_model

    patches = find_patches(data)
    with progress_bars("") as progress:
        model, metrics = fit_model(patches, settings, jobs=jobs, progress=progress)
    save_model(model, output, overwrite=overwrite)
    print_lines(*metrics.lines(), "", f"{output}: written")


@command()
@click.argument("videos", nargs=-1, required=True, type=options.PATH, metavar="IN...")
@options.truths_option
@options.output_file("-o", "--output", required=True, help="Zip file to write.")
@options.number_option("--every", default=4, help="Use every N-th frame of a video.")
@options.number_option(
    "--from", "first", metavar="FRAME", default=1, help="Start at this frame, counted from 1."
)
@options.until_option
@options.model_option
@options.settings_options
@options.overwrite_option
def mine(
    videos: Paths,
    truths: Paths,
    output: Path,
    every: int,
    first: int,
    until: int | None,
    source: SettingsSource,
    overwrite: bool,
) -> None:
    """Cut patches for vdet train out of labelled videos.

    Writes the labelled vehicles with their boxes, and false alarms of the model, also on parts of
    vehicles. Ignore regions are skipped.

    \b
    Examples:
      vdet mine a.mp4 b.mp4 --truth a.txt --truth b.txt -o mined.zip
    """
    if until is not None and until < first:
        raise click.UsageError("--until must not be before --from")
    files = OutputFiles(overwrite=overwrite, inputs=source.inputs(*videos, *truths))
    files.check(output, suffixes=(".zip",), noun="patches")
    settings = source.load(detector="svm")
    options.reject_regions(settings)
    from vdet.detect.svm.detector import load_svm
    from vdet.learn.svm import mining

    sources = [
        mining.VideoSource(video, truth, every, first, until)
        for video, truth in options.with_truths(videos, truths)
    ]
    svm = load_svm(settings.svm, Path(settings.svm.model) if settings.svm.model else None)
    with progress_bars(" frames") as progress:
        frames, counts = mining.mine(
            sources, output, settings, svm, overwrite=overwrite, progress=progress
        )
    vehicles = f"{counts['vehicle']} patches of vehicles, {counts['box']} more for their boxes"
    alarms = f"{counts['false alarm']} false alarms, {counts['part']} more on parts of vehicles"
    print_lines(f"{output}: {vehicles}, {alarms}; from {quantity(frames, 'frame')}")


@command()
@click.argument("data", nargs=-1, type=options.PATH, metavar="[DATA]...")
@options.output_file("-o", "--output", required=True, help="Network to write, .onnx.")
@options.input_file(
    "--video",
    "clips",
    metavar="CLIP TRUTH",
    nargs=2,
    multiple=True,
    help="Also train on every fourth frame of a labelled video. Can be repeated.",
)
@options.input_file(
    "--base",
    help="Start from the weights of a network of vdet train-net, or of the shipped one: default.",
)
@click.option(
    "--device",
    type=click.Choice(["auto", "cpu", "cuda"]),
    metavar="NAME",
    default="auto",
    show_default=True,
    help="Compute on auto (a GPU if torch finds one), cpu or cuda.",
)
@options.settings_options
@options.overwrite_option
def train_net(
    data: Paths,
    output: Path,
    clips: tuple[tuple[Path, Path], ...],
    base: Path | None,
    device: str,
    source: SettingsSource,
    overwrite: bool,
) -> None:
    """Train a network on labelled images.

    Each DATA is a set of labelled images in COCO or YOLO format. The state is saved beside
    the network, as .ckpt; if training stops, run the same command to resume.
    Requires torch and onnx: pip install torch onnx

    \b
    Examples:
      vdet train-net images/city images/motorway -o mine.onnx
      vdet train-net images/ -o mine.onnx --video drive.mp4 drive-truth.txt
    """
    if not data and not clips:
        raise click.UsageError("nothing to learn from; pass DATA or --video")
    from vdet.detect.onnx.detector import SHIPPED

    base = SHIPPED if base == Path("default") else base
    inputs = source.inputs(*data, *chain(*clips), *([base] if base else ()))
    files = OutputFiles(overwrite=overwrite, inputs=inputs)
    files.check(output, suffixes=(".onnx",), noun="networks")
    settings = source.load()
    with needing("train"):
        from vdet.learn.net.sources import clip_source, image_source
        from vdet.learn.net.training import train_to_file
    from vdet.labels.reading import Roles, read_labelled_images

    limit_library_threads()
    roles = Roles.for_training(settings)
    sources = [image_source(read_labelled_images(path, roles), settings) for path in data]
    sources += [clip_source(clip, truth, settings) for clip, truth in clips]
    print_lines(*(line for source in sources for line in source.lines()), "")
    steps, losses = settings.train.net.steps, list[float]()
    with progress_bar(total=steps, unit=" steps") as bar:

        def advance(step: int, loss: float) -> None:
            losses.append(loss)
            bar.set_postfix_str(f"loss {loss:.3f}", refresh=False)
            bar.update(step - bar.n)

        train_to_file(
            sources,
            settings.train.net,
            output,
            base=base,
            device=device,
            overwrite=overwrite,
            progress=advance,
        )
    if losses:
        first, last = fmean(losses[:_AVERAGED]), fmean(losses[-_AVERAGED:])
        print_lines(f"loss: {first:.3f} at the start, {last:.3f} at the end")
    if not base and steps < _FEW_STEPS:
        advice = "set more train.net.steps, or --base default"
        LOG.warning(
            "%s: finds nothing after %d steps from random weights; %s", output, steps, advice
        )
    print_lines(f"{output}: written")

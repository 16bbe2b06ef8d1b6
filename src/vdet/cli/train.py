"""`vdet mine`, `vdet train` and `vdet train-net`: from labelled data to models."""

import json
from dataclasses import asdict
from pathlib import Path

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import live_bar, print_lines, progress_steps
from vdet.errors import DataError, counted
from vdet.files import OutputFiles, check_output, output_errors, write_text


@command(
    "vdet train vehicles.zip non-vehicles.zip mined.zip -o model.npz",
    "vdet train patches/ -o model.npz --set train.svm.C=1e-3",
)
@click.argument("data", nargs=-1, required=True, type=options.INPUT, metavar="DATA...")
@options.output_file_option("Model file to write, .npz.")
@options.settings_options("train.svm.C=1e-4")
@options.jobs_option("Describe patches in N threads.")
@options.overwrite_option
def train(
    data: tuple[Path, ...],
    output: Path,
    choice: options.SettingsChoice,
    jobs: int | None,
    overwrite: bool,
) -> None:
    """Train a linear model on labelled patches.

    Each DATA is a folder or a zip file with pictures in vehicles/<group>/ and
    non-vehicles/<group>/. A file boxes.csv beside these folders says where in a patch the vehicle
    is; vdet mine writes it. With it the model learns where the sides of vehicles are. The metrics
    are printed, and written beside the model as model.npz.json.
    """
    settings = choice.read(detector="svm")
    options.check_suffix(output, ".npz", what="models")
    metrics_path = output.with_name(f"{output.name}.json")
    for path in (output, metrics_path):
        check_output(path, overwrite=overwrite)
    from vdet.detect.svm.model import save_model
    from vdet.learn.svm.dataset import find_patches
    from vdet.learn.svm.training import train as fit_model

    files = find_patches(data)
    with progress_steps("") as steps:
        model, metrics = fit_model(files, settings, jobs=jobs, steps=steps)
    with OutputFiles(overwrite=overwrite) as outputs:
        with output_errors(output):
            save_model(model, outputs.stage(output))
        with output_errors(metrics_path):
            write_text(outputs.stage(metrics_path), json.dumps(asdict(metrics), indent=2) + "\n")
    print_lines(*metrics.lines(), "", f"{output}: the model; {metrics_path}: the metrics")


@command(
    "vdet mine in.mp4 --truth gt.txt -o mined.zip",
    "vdet mine a.mp4 b.mp4 --truth a.txt --truth b.txt pictures/ -o mined.zip",
)
@click.argument("sources", nargs=-1, required=True, type=options.INPUT, metavar="SOURCE...")
@options.truth_option
@options.output_file_option("Zip file to write.")
@options.option("--every N", "Use every N-th frame of a video.", options.POSITIVE, default=4)
@options.option(
    "--from FRAME",
    "Begin at this frame, counted from 1.",
    options.POSITIVE,
    name="first",
    default=1,
)
@options.until_option
@options.settings_options("labels.roles.tram=vehicle", options.model_option)
@options.overwrite_option
def mine(
    sources: tuple[Path, ...],
    truths: tuple[Path, ...],
    output: Path,
    every: int,
    first: int,
    until: int | None,
    choice: options.SettingsChoice,
    overwrite: bool,
) -> None:
    """Cut patches for vdet train out of labelled videos and pictures.

    Each SOURCE is a video with a --truth, or labelled pictures: a folder (COCO, KITTI, YOLO or
    Pascal VOC), or a COCO file.

    Vehicles are cut out where the truth has them, and come with their boxes. False alarms are cut
    out too: windows that the model takes for vehicles where there is none, or only a part of one.
    Nothing is cut out of ignore regions.
    """
    if until is not None and until < first:
        raise click.UsageError("--until must not be before --from")
    options.check_suffix(output, ".zip", what="patches")
    settings = choice.read_for_whole_frames(detector="svm")
    from vdet.detect.svm.kind import load_svm
    from vdet.labels.reading import holds_labelled_pictures
    from vdet.learn.svm import mining

    check_output(output, overwrite=overwrite)
    videos = [path for path in sources if not holds_labelled_pictures(path)]
    if len(videos) != len(truths):
        given = f"videos: {len(videos)}, truths: {len(truths)}"
        raise click.UsageError(f"pass one --truth for each video ({given})")
    labels = dict(zip(videos, truths, strict=True))
    labelled = [
        mining.VideoSource(path, labels[path], every, first, until)
        if path in labels
        else mining.PictureSource(path)
        for path in sources
    ]
    model = load_svm(settings.svm, Path(settings.svm.model) if settings.svm.model else None)
    with progress_steps(" frames") as steps:
        frames, counts = mining.mine(
            labelled, output, settings, model, overwrite=overwrite, steps=steps
        )
    found = f"{counts['vehicle']} patches of vehicles, {counts['box']} more for their boxes"
    alarms = f"{counts['false alarm']} false alarms, {counts['part']} more on parts of vehicles"
    print_lines(f"{output}: {found}, {alarms}; from {counted(frames, 'frame')}")


@command(
    "vdet train-net pictures/city pictures/motorway -o mine.onnx",
    "vdet train-net pictures/ -o mine.onnx --video drive.mp4 drive-truth.txt",
)
@click.argument("data", nargs=-1, type=options.INPUT, metavar="[DATA]...")
@options.output_file_option("Network to write, .onnx.")
@options.option(
    "--video CLIP TRUTH",
    "Learn from every fourth frame of a labelled video too. Can be repeated.",
    options.INPUT,
    name="clips",
    nargs=2,
    multiple=True,
)
@options.option("--base FILE", "Start from the weights of a network of vdet train-net.")
@options.settings_options("train.net.steps=4000")
@options.overwrite_option
def train_net(
    data: tuple[Path, ...],
    output: Path,
    clips: tuple[tuple[Path, Path], ...],
    base: Path | None,
    choice: options.SettingsChoice,
    overwrite: bool,
) -> None:
    """Train a network on labelled pictures.

    Each DATA is a set of labelled pictures: COCO, KITTI, YOLO or Pascal VOC. The training saves its
    state beside the network, as .ckpt; if it is stopped, the same command resumes it.
    Needs torch and onnx: pip install torch onnx
    """
    if not data and not clips:
        raise click.UsageError("nothing to learn from; pass DATA or --video")
    options.check_suffix(output, ".onnx", what="networks")
    settings = choice.read()
    try:
        from vdet.learn.net.sources import clip_source, picture_source
        from vdet.learn.net.training import train_to_file
    except ImportError as error:
        raise DataError(f"{error.name} is not installed; pip install torch onnx") from error
    from vdet.labels.reading import read_labelled_pictures
    from vdet.labels.roles import Roles
    from vdet.workers import limit_library_threads

    limit_library_threads()
    check_output(output, overwrite=overwrite)
    roles = Roles.for_training(settings)
    sources = [picture_source(read_labelled_pictures(path, roles), settings) for path in data]
    sources += [clip_source(clip, truth, settings) for clip, truth in clips]
    check_output(output, overwrite=overwrite)  # it may be among the files that were read now
    print_lines(*(line for _, report in sources for line in report.lines()), "")
    with live_bar(total=settings.train.net.steps, unit=" steps") as bar:

        def advance(step: int, loss: float) -> None:
            bar.set_postfix_str(f"loss {loss:.3f}", refresh=False)
            bar.update(step - bar.n)

        done = train_to_file(
            sources, settings.train.net, output, base=base, overwrite=overwrite, progress=advance
        )
    print_lines(done, f"{output}: the network")

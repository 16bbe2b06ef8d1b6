"""`vdet train-net`: from labelled pictures to a network."""

from pathlib import Path

import click

from vdet.cli.command import Command
from vdet.cli.messages import print_lines, steps_bar
from vdet.cli.options import PATH, overwrite_option, read_settings, settings_options
from vdet.errors import DataError, OutputError
from vdet.files import check_output
from vdet.workers import limit_library_threads


@click.command(
    "train-net",
    cls=Command,
    examples=(
        "vdet train-net pictures/city pictures/motorway -o mine.onnx",
        "vdet train-net pictures/ -o mine.onnx --video drive.mp4 drive-truth.txt",
    ),
)
@click.argument("data", nargs=-1, type=PATH, metavar="[DATA]...")
@click.option(
    "-o", "--output", required=True, type=PATH, metavar="FILE", help="Network to write, .onnx."
)
@click.option(
    "--video",
    "clips",
    nargs=2,
    multiple=True,
    type=PATH,
    metavar="CLIP TRUTH",
    help="Learn from every n-th frame of a labelled video too (train.net.every). Can be repeated.",
)
@click.option(
    "--base",
    type=PATH,
    metavar="FILE",
    help="Start from the weights of this network, which vdet train-net has written.",
)
@settings_options("train.net.steps=4000")
@overwrite_option
@click.pass_obj
def train_net(
    quiet: bool,
    *,
    data: tuple[Path, ...],
    output: Path,
    clips: tuple[tuple[Path, Path], ...],
    base: Path | None,
    config_name: str | None,
    assignments: tuple[str, ...],
    overwrite: bool,
) -> None:
    """Train a network on labelled pictures.

    Each DATA is a set of labelled pictures: COCO, KITTI, YOLO or Pascal VOC. The state of the
    training is kept beside the network, as .ckpt; a training that was stopped goes on from there
    when the same command is given again. The metrics are written beside the network as JSON.
    Needs torch and onnx: pip install torch onnx
    """
    limit_library_threads()
    if not data and not clips:
        raise click.UsageError("nothing to learn from; give DATA or --video")
    if output.suffix.lower() != ".onnx":
        raise OutputError(f"{output}: networks are written as .onnx; name it so")
    settings = read_settings(config_name, assignments).train.net
    try:
        import onnx  # noqa: F401
        import torch  # noqa: F401
    except ImportError as error:
        raise DataError("torch or onnx is not installed; pip install torch onnx") from error
    from vdet.learn.net.run import NetworkJob, train_to_file
    from vdet.learn.net.sources import LabelledClip

    labelled = tuple(LabelledClip(video, truth, settings.every) for video, truth in clips)
    job = NetworkJob(data, labelled, output, base, overwrite)
    inputs = [*data, *([base] if base else []), *(path for clip in clips for path in clip)]
    for path in (job.output, job.metrics):
        check_output(path, overwrite=overwrite, inputs=inputs)
    with steps_bar(settings.steps, quiet=quiet) as advance:
        metrics = train_to_file(job, settings, progress=advance)
    print_lines(*metrics.lines(), "", f"{output}: the network; {job.metrics}: the metrics")

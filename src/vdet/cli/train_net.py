"""`vdet train-net`: from labelled pictures to a network."""

from pathlib import Path

import click

from vdet.cli import options
from vdet.cli.command import command
from vdet.cli.messages import live_bar, print_lines
from vdet.errors import DataError
from vdet.files import check_output


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
    state beside the network, as .ckpt; if it is stopped, the same command resumes it. The metrics
    are written beside the network, as JSON.
    Needs torch and onnx: pip install torch onnx
    """
    if not data and not clips:
        raise click.UsageError("nothing to learn from; pass DATA or --video")
    options.check_suffix(output, ".onnx", what="networks")
    settings = choice.read()
    try:
        from vdet.learn.net.run import NetworkJob, read_sources, source_lines, train_to_file
    except ImportError as error:
        raise DataError(f"{error.name} is not installed; pip install torch onnx") from error
    from vdet.workers import limit_library_threads

    limit_library_threads()
    job = NetworkJob(data, clips, output, base, overwrite)
    for path in (job.output, job.metrics):
        check_output(path, overwrite=overwrite)
    sources = read_sources(job, settings)
    for path in (job.output, job.metrics):  # one may be among the files that were read now
        check_output(path, overwrite=overwrite)
    print_lines(*source_lines([report for _, report in sources]), "")
    with live_bar(total=settings.train.net.steps, unit=" steps") as bar:

        def advance(step: int, loss: float) -> None:
            bar.set_postfix_str(f"loss {loss:.3f}", refresh=False)
            bar.update(step - bar.n)

        metrics = train_to_file(job, sources, settings, progress=advance)
    print_lines(*metrics.lines(), f"{output}: the network; {job.metrics}: the metrics")

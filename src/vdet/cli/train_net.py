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

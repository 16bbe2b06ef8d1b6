"""`vdet info`: what a video, a picture or a model file is."""

from pathlib import Path

import click

from vdet.cli.clip_info import clip_facts, picture_facts
from vdet.cli.command import Command
from vdet.cli.model_info import linear_facts, network_facts
from vdet.cli.options import PATH, facts_options, print_facts
from vdet.files import check_output
from vdet.media.images import is_picture_name

_FACTS = {".npz": linear_facts, ".onnx": network_facts}


@click.command(
    cls=Command,
    examples=("vdet info in.mp4", "vdet info in.mp4 --json -", "vdet info model.npz"),
)
@click.argument("path", type=PATH, metavar="FILE")
@facts_options
def info(path: Path, json_target: str | None, overwrite: bool) -> None:
    """Say what a file is: a video, a picture or a model.

    FILE is a video or numbered pictures (what it holds, what of it a written video keeps or loses,
    where the horizon lies), a picture, a linear model (.npz), or a network (.onnx) of vdet or of
    another tool.
    """
    if json_target not in (None, "-"):
        check_output(Path(json_target), overwrite=overwrite, inputs=[path])
    describe = _FACTS.get(path.suffix.lower())
    if describe is None:
        describe = picture_facts if is_picture_name(path) and "%" not in path.name else clip_facts
    print_facts(describe(path), json_target, overwrite=overwrite)

"""`vdet eval`: how well it works, in numbers."""

import click

from vdet.cli.eval_patches import patches
from vdet.cli.eval_tracks import tracks
from vdet.cli.eval_video import video


@click.group("eval")
def evaluate() -> None:
    """Measure the classifier, or detection and tracking on labelled video."""


for _command in (patches, tracks, video):
    evaluate.add_command(_command)

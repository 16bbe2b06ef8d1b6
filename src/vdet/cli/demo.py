"""`vdet demo`: the whole program on synthetic roads."""

from pathlib import Path

import click

from vdet.cli.command import command
from vdet.cli.messages import announce, print_lines, progress_bars
from vdet.cli.options import PATH, number_option, overwrite_option


@command()
@click.argument("folder", default=Path("demo"), type=PATH, metavar="[DIR]")
@number_option("--seed", type=click.IntRange(min=0), default=5, help="Seed of the random scenes.")
@overwrite_option
def demo(folder: Path, seed: int, overwrite: bool) -> None:
    """Try the whole program on synthetic roads.

    Draws two roads with vehicles, from a moving camera and from a pole. The network finds the
    vehicles, and counts those seen from the pole. Then a linear model, trained on patches of other
    synthetic roads, finds them too. All results are compared with the ground truth, and written
    into DIR, by default demo.

    \b
    Examples:
      vdet demo folder --seed 2 --overwrite
    """
    from vdet.demo import run_demo

    with progress_bars("") as progress:
        lines = run_demo(
            folder, seed=seed, overwrite=overwrite, announce=announce, progress=progress
        )
    print_lines(
        *lines,
        "",
        f"All files are in {folder}: found.mp4 and page/page.html are worth a look.",
        "Next, try your own video:  vdet detect-video in.mp4",
    )

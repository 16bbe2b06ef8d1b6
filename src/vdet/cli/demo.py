"""`vdet demo`: the whole program on synthetic roads."""

from pathlib import Path

import click

from vdet.cli.command import command
from vdet.cli.messages import announce, print_lines, progress_steps
from vdet.cli.options import PATH, option, overwrite_option


@command()
@click.argument("folder", default=Path("demo"), type=PATH, metavar="[DIR]")
@option("--seed N", click.IntRange(min=0), default=5)
@overwrite_option
def demo(folder: Path, seed: int, overwrite: bool) -> None:
    """Try the whole program on synthetic roads.

    Draws two roads with vehicles, from a moving camera and from a pole. The network finds the
    vehicles, and counts those seen from the pole. Then a linear model is trained on patches of
    other synthetic roads and finds the vehicles too. All results are compared with the ground
    truth. All files are written into DIR, by default demo.

    Parameters
    ----------
    seed
        Seed of the random scenes.

    Examples
    --------
    vdet demo
    vdet demo folder --seed 2 --overwrite
    """
    from vdet.demo import MODEL, TRUTH, run_demo

    with progress_steps("") as steps:
        result = run_demo(folder, seed=seed, overwrite=overwrite, announce=announce, steps=steps)
    print_lines(
        *result,
        "",
        "Results:",
        f"  {folder / 'found.mp4'}  the road with the vehicles that the network found",
        f"  {folder / 'counted.mp4'}  the road from the pole, with lines and counts",
        f"  {folder / 'page' / 'page.html'}  its page; {folder / 'flows.csv'} has the flows",
        f"  {folder / 'found.csv'}  the tracks; {folder / TRUTH} has the ground truth",
        f"  {folder / 'stages'}/  every stage of the linear model in one frame",
        f"  {folder / MODEL}  the linear model; vdet info --json prints its metrics",
        "Next, try your own video:  vdet detect-video in.mp4 out.mp4",
    )

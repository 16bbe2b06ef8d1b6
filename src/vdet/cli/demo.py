"""`vdet demo`: the whole program on synthetic roads."""

from pathlib import Path

import click

from vdet.cli.command import command
from vdet.cli.messages import announce, print_lines, progress_steps
from vdet.cli.options import PATH, number_option, overwrite_option


@command()
@click.argument("folder", default=Path("demo"), type=PATH, metavar="[DIR]")
@number_option("--seed", type=click.IntRange(min=0), default=5, help="Seed of the random scenes.")
@overwrite_option
def demo(folder: Path, seed: int, overwrite: bool) -> None:
    """Try the whole program on synthetic roads.

    Draws two roads with vehicles, from a moving camera and from a pole. The network finds the
    vehicles, and counts those seen from the pole. Then a linear model is trained on patches of
    other synthetic roads and finds the vehicles too. All results are compared with the ground
    truth. All files are written into DIR, by default demo.

    \b
    Examples:
      vdet demo
      vdet demo folder --seed 2 --overwrite
    """
    from vdet.demo import MODEL, TRUTH, run_demo

    with progress_steps("") as steps:
        lines = run_demo(folder, seed=seed, overwrite=overwrite, announce=announce, steps=steps)
    files = {
        "found.mp4": "the road with the vehicles that the network found",
        "found.csv": f"their tracks; {folder / TRUTH} has the ground truth",
        "counted.mp4": "the road from the pole, with lines and counts",
        "page/page.html": f"its page; {folder / 'flows.csv'} has the flows",
        "stages": "every stage of the linear model in one frame",
        MODEL: "the linear model; vdet info FILE --json - prints its metrics",
    }
    paths = {str(folder / name): text for name, text in files.items()}
    width = max(map(len, paths))
    print_lines(
        *lines,
        "",
        "Results:",
        *(f"  {path:{width}}  {text}" for path, text in paths.items()),
        "Next, try your own video:  vdet detect-video in.mp4",
    )

"""`vdet demo`: the whole system on a made-up road."""

from pathlib import Path

import click

from vdet.cli.options import PathOf, overwrite_option, read_settings, settings_options
from vdet.cli.progress import progress_bar


@click.command()
@click.argument("folder", default=Path("demo"), type=PathOf(), metavar="[DIR]")
@click.option("--seed", default=1, show_default=True, type=click.IntRange(min=0))
@settings_options
@overwrite_option
@click.pass_obj
def demo(
    quiet: bool,
    *,
    folder: Path,
    seed: int,
    config_name: str | None,
    assignments: tuple[str, ...],
    overwrite: bool,
) -> None:
    """Draw a road with vehicles, train, detect, and compare with the truth, all in DIR."""
    from vdet.demo import DemoFiles, check_demo, run_demo

    settings = read_settings(config_name, assignments)
    files = DemoFiles(folder)
    check_demo(files, overwrite=overwrite)
    with progress_bar("", quiet=quiet) as progress:
        result = run_demo(
            files, settings, seed=seed, say=(lambda _: None) if quiet else _say, progress=progress
        )
    for split in result.training.splits:
        click.echo(f"patches, {split.split} split: test accuracy {split.test_accuracy:.3f}")
    scores = result.scores
    click.echo(
        f"video: {result.frames} frames in {result.seconds:.1f} s "
        f"({result.frames / result.seconds:.1f} frames/s)\n"
        f"found boxes against the truth: precision {scores.precision:.2f}, "
        f"recall {scores.recall:.2f}, F1 {scores.f1:.2f} at IoU 0.5; "
        f"IDF1 {scores.idf1:.2f}, {scores.id_switches} id switches\n\n"
        f"Look at\n"
        f"  {files.result}  the road with the vehicles found\n"
        f"  {files.stages}/  every stage of one frame as a picture\n"
        f"  {files.tracks}  the boxes, a record a frame; {files.truth} has the true ones\n"
        f"  {files.report}  what training measured\n"
        f"Then try your own:  vdet detect-video in.mp4 out.mp4"
    )


def _say(line: str) -> None:
    click.echo(line, err=True)

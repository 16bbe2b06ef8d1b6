"""Options that the commands of `vdet eval` share."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import click

from vdet.cli.options import PathOf, overwrite_option
from vdet.evaluate.output import write_page
from vdet.files import write_json

F = TypeVar("F", bound=Callable[..., Any])


def results_options(command: F) -> F:
    """Add `--json FILE`, `--report DIR` and `--overwrite`: where results go beside the table."""
    command = overwrite_option(command)
    command = click.option(
        "--report", type=PathOf(), metavar="DIR", help="Write report.html into this folder."
    )(command)
    return click.option(
        "--json",
        "json_target",
        metavar="FILE",
        help="All numbers; - for standard output (the table then goes to standard error).",
    )(command)


def give_results(
    lines: Iterable[str],
    values: Mapping[str, Any],
    make_page: Callable[[], str],
    *,
    json_target: str | None,
    report: Path | None,
) -> None:
    """Print the table, and write what `results_options` asked for."""
    aside = json_target == "-"  # standard output is taken
    click.echo("\n".join(lines), err=aside)
    if json_target is not None:
        write_json(values, json_target)
    if report is not None:
        click.echo(f"\n{write_page(make_page(), report)}: the report", err=aside)

"""`vdet config`: the effective settings."""

import click

from vdet.cli.options import read_settings, settings_options
from vdet.config.rendering import render


@click.command()
@settings_options
def config(config_name: str | None, assignments: tuple[str, ...]) -> None:
    """Print the effective settings as commented YAML."""
    click.echo(render(read_settings(config_name, assignments)), nl=False)

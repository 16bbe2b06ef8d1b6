"""`vdet config`: the effective settings."""

from vdet.cli.command import command
from vdet.cli.messages import print_lines
from vdet.cli.options import SettingsChoice, settings_options


@command("vdet config > my.yaml", "vdet config -c seed --set output.crf=18")
@settings_options("tracker.kind=rules")
def config(choice: SettingsChoice) -> None:
    """Print the effective settings as commented YAML.

    Save them, change what you like, and pass the file to a command with -c.
    """
    from vdet.config.rendering import render

    print_lines(*render(choice.read()).splitlines())

"""Commands with `-q` and `-v`, and the program, which other packages extend."""

import logging
from functools import partial
from typing import Any

import click

from vdet.cli.messages import LOG, is_quiet
from vdet.plugins import COMMANDS, built_in_names, load_plugin, plugin_names


class Command(click.Command):
    """A command of the program, with `-q` and `-v`."""

    def __init__(self, *names: Any, **attributes: Any) -> None:
        super().__init__(*names, **attributes)
        self.params += verbosity_options()


command = partial(click.command, cls=Command)


class Program(click.Group):
    """The program; commands are imported when they are run, or to list their summaries.

    Other packages register commands as entry points (`vdet.plugins`).
    """

    def list_commands(self, _: click.Context) -> list[str]:
        """Return the names of all commands in alphabetical order."""
        return sorted(plugin_names(COMMANDS))

    def get_command(self, _: click.Context, name: str) -> click.Command | None:
        """Return a command; None if the name is unknown.

        Raises
        ------
        ConfigError
            It belongs to another package that cannot be loaded.
        """
        if name not in plugin_names(COMMANDS):
            self.commands = {name: load_plugin(COMMANDS, name) for name in built_in_names(COMMANDS)}
            return None  # click suggests one of `commands`
        command: click.Command = load_plugin(COMMANDS, name)
        return command

    def format_commands(self, _: click.Context, formatter: click.HelpFormatter) -> None:
        """Write all names with their summaries; commands of other packages are not imported."""
        summaries = dict.fromkeys(plugin_names(COMMANDS), "Added by an installed package.")
        for name in built_in_names(COMMANDS):
            summaries[name] = load_plugin(COMMANDS, name).get_short_help_str(limit=200)
        with formatter.section("Commands"):
            formatter.write_dl(sorted(summaries.items()))


def verbosity_options() -> list[click.Parameter]:
    """Return `--quiet` and `--verbose`, which mean the same before and after the command."""
    flag = partial(click.Option, is_flag=True, expose_value=False, callback=_set_verbosity)
    return [
        flag(["-q", "--quiet"], help="Print only errors, no progress and no warnings."),
        flag(["-v", "--verbose"], help="Print more detail."),
    ]


def _set_verbosity(_: click.Context, option: click.Parameter, is_set: bool) -> None:
    if is_set and not is_quiet():  # --quiet wins
        LOG.setLevel(logging.ERROR if option.name == "quiet" else logging.DEBUG)

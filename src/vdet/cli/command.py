"""Commands whose help groups its options, and the program, which other packages extend."""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import click

from vdet.cli.messages import set_up_logs
from vdet.errors import ConfigError
from vdet.plugins import COMMANDS, load_plugin, plugin_names

_OTHERS = "What is processed"

HEADINGS: Mapping[str, Sequence[str]] = {
    "Outputs": (
        *("--output", "--no-video", "--tracks", "--counts", "--vehicles", "--crops", "--json"),
        *("--page", "--preview", "--stages", "--at", "--sink", "--overwrite"),
    ),
    _OTHERS: (),
    "Several videos": ("--directory", "--skip-existing", "--dry-run"),
    "Lanes": ("--lanes", "--camera"),
    "Model and settings": ("--model", "--base", "--config", "--set"),
    "Parallel work": ("--jobs", "--threads", "--scheduler"),
    "General": ("--quiet", "--verbose", "--version", "--help"),
}
"""Heading of each option in the help, in order. Options that are not named come under `_OTHERS`."""


class Command(click.Command):
    """A command of the program; its help ends with examples, and it takes `-q` and `-v`."""

    examples: Sequence[str] = ()

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.params += verbosity_options()
        # click cuts only summaries that are not given.
        self.short_help = re.split(r"(?<=\.)\s", (self.help or "").strip())[0]

    def format_options(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options under their headings, and the examples."""
        records = {
            parameter.opts[-1]: record
            for parameter in self.get_params(context)
            if isinstance(parameter, click.Option)
            and (record := parameter.get_help_record(context))
        }
        named = {name for names in HEADINGS.values() for name in names}
        others = [name for name in records if name not in named]
        for heading, names in HEADINGS.items():
            rows = [records[name] for name in names or others if name in records]
            if rows:
                with formatter.section(heading):
                    formatter.write_dl(rows)
        if self.examples:
            with formatter.section("Examples"):
                for line in self.examples:
                    formatter.write(f"{'':{formatter.current_indent}}{line}\n")


def command(*examples: str) -> Callable[[Callable[..., Any]], Command]:
    """Return a decorator that makes a command, with command lines that its help shows."""

    def make(function: Callable[..., Any]) -> Command:
        made = click.command(cls=Command)(function)
        made.examples = examples
        return made

    return make


class Program(click.Group):
    """The program; other packages register commands as entry points (`vdet.plugins`)."""

    def list_commands(self, _: click.Context) -> list[str]:
        """Return the names of all commands in alphabetical order."""
        return sorted({*self.commands, *plugin_names(COMMANDS)})

    def get_command(self, _: click.Context, name: str) -> click.Command | None:
        """Return a command, None if there is none of that name.

        Raises
        ------
        ConfigError
            It belongs to another package, and cannot be loaded.
        """
        if name in self.commands or name not in plugin_names(COMMANDS):
            return self.commands.get(name)
        command = load_plugin(COMMANDS, name)
        if not isinstance(command, click.Command):
            raise ConfigError(f"{name}: is no click command; repair or reinstall that package")
        return command

    def format_commands(self, _: click.Context, formatter: click.HelpFormatter) -> None:
        """Write all names with their summaries; commands of other packages are not imported."""
        own = {name: command.short_help or "" for name, command in self.commands.items()}
        others = dict.fromkeys(plugin_names(COMMANDS), "Added by an installed package.")
        with formatter.section("Commands"):
            formatter.write_dl(sorted((others | own).items()))


def verbosity_options() -> list[click.Parameter]:
    """Return `--quiet` and `--verbose`, which mean the same before and after the command."""
    quiet = "Print no progress and no warnings, only errors."
    verbose = "Print more about what is done."
    return [
        click.Option(
            [f"-{name[0]}", f"--{name}"],
            is_flag=True,
            expose_value=False,
            callback=_apply_verbosity,
            help=text,
        )
        for name, text in (("quiet", quiet), ("verbose", verbose))
    ]


def _apply_verbosity(context: click.Context, option: click.Parameter, given: bool) -> None:
    if given:
        context.obj = context.obj or option.name == "quiet"
        set_up_logs(verbose=option.name == "verbose", quiet=bool(context.obj))

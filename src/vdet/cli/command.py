"""Commands with grouped options in their help, and the program, which other packages extend."""

import inspect
import re
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import click

from vdet.cli import options as shared
from vdet.cli.messages import set_up_logs
from vdet.plugins import COMMANDS, built_in_names, load_plugin, plugin_names

_OTHERS = "Input"
_PARAMETERS, _EXAMPLES = "Parameters\n----------\n", "Examples\n--------\n"
_PARAMETER = re.compile(r"^(\w+)\n((?:    .+\n)+)", re.MULTILINE)

HEADINGS: Mapping[str, Sequence[str]] = {
    "Outputs": (
        *("--output", "--no-video", "--tracks", "--counts", "--flows", "--interval", "--vehicles"),
        "--class",
        *("--crops", "--clips", "--margin", "--exact", "--json", "--labels", "--page"),
        *("--propose", "--stages", "--at", "--sink", "--overwrite"),
    ),
    _OTHERS: (),
    "Batch": ("--directory", "--skip-existing", "--dry-run"),
    "Lanes": ("--lanes",),
    "Model and settings": ("--model", "--base", "--config", "--set"),
    "Parallel work": ("--jobs", "--threads", "--scheduler"),
    "General": ("--quiet", "--verbose", "--version", "--help"),
}
"""The headings in the help, in order, with their options. Other options go under `_OTHERS`."""


class Command(click.Command):
    """A command of the program, with `-q` and `-v` and grouped options in its help.

    The docstring is the help: what the command does, its options as `Parameters`, and command lines
    as `Examples`. Options without a text have that of the docstring of `vdet.cli.options`.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        text, _, self.epilog = inspect.cleandoc(self.help or "").partition(_EXAMPLES)
        self.help, _, listed = text.partition(_PARAMETERS)
        texts = dict(_PARAMETER.findall(f"{shared.__doc__}\n{listed}"))
        for option in self.params:
            if isinstance(option, click.Option) and option.help is None:
                option.help = " ".join(texts.get(option.name or "", "").split())
        self.params += verbosity_options()
        # click truncates the summary unless it is set.
        self.short_help = re.split(r"(?<=\.)\s", (self.help or "").strip())[0]

    def format_options(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options under their headings."""
        headings = {name: heading for heading, names in HEADINGS.items() for name in names}
        rows: dict[str, list[tuple[str, str]]] = {heading: [] for heading in HEADINGS}
        for parameter in self.get_params(context):
            record = parameter.get_help_record(context)
            if record and isinstance(parameter, click.Option):
                rows[headings.get(parameter.opts[-1], _OTHERS)].append(record)
        for heading, group in rows.items():
            if group:
                with formatter.section(heading):
                    formatter.write_dl(group)

    def format_epilog(self, _: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the examples."""
        with formatter.section("Examples"):
            formatter.write_text(f"\b\n{self.epilog}")


command = partial(click.command, cls=Command)
"""Makes a command from a function and its docstring: see `Command`."""


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
        if name not in built_in_names(COMMANDS) and name not in plugin_names(COMMANDS):
            self.commands = {own: load_plugin(COMMANDS, own) for own in built_in_names(COMMANDS)}
            return None  # click suggests one of `commands`
        command: click.Command = load_plugin(COMMANDS, name)
        return command

    def format_commands(self, _: click.Context, formatter: click.HelpFormatter) -> None:
        """Write all names with their summaries; commands of other packages are not imported."""
        own = {name: load_plugin(COMMANDS, name).short_help for name in built_in_names(COMMANDS)}
        others = dict.fromkeys(plugin_names(COMMANDS), "Added by an installed package.")
        with formatter.section("Commands"):
            formatter.write_dl(sorted((others | own).items()))


def verbosity_options() -> list[click.Parameter]:
    """Return `--quiet` and `--verbose`, which mean the same before and after the command."""
    make = partial(click.Option, is_flag=True, expose_value=False, callback=_apply_verbosity)
    return [
        make(["-q", "--quiet"], help="Print only errors, no progress and no warnings."),
        make(["-v", "--verbose"], help="Print more detail."),
    ]


def _apply_verbosity(context: click.Context, option: click.Parameter, given: bool) -> None:
    if given:
        context.obj = context.obj or option.name == "quiet"
        set_up_logs(verbose=option.name == "verbose", quiet=bool(context.obj))

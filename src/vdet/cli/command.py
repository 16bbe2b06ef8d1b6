"""Commands whose help groups its options, and groups that import a command when it is asked for."""

import re
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from importlib import import_module
from typing import Any

import click

from vdet.cli.messages import set_up_logs

HEADINGS: Mapping[str, Sequence[str]] = {
    "Outputs": (
        *("--output", "--no-video", "--tracks", "--counts", "--summary", "--crops", "--json"),
        *("--page", "--preview", "--stages", "--at", "--sink", "--overwrite"),
    ),
    "What is processed": (
        *("--truth", "--video", "--start", "--end", "--frames", "--stride", "--every", "--from"),
        *("--until", "--regions", "--lines", "--size", "--rate", "--seed", "--split", "--sweep"),
        *("--pattern", "--score", "--least-width"),
    ),
    "Several videos": ("--directory", "--skip-existing", "--dry-run"),
    "Lanes": ("--lanes", "--camera"),
    "Model and settings": ("--model", "--base", "--config", "--set"),
    "Parallel work": ("--jobs", "--threads", "--scheduler"),
    "General": ("--quiet", "--verbose", "--version", "--help"),
}
"""Under which heading of the help an option stands, and in which order."""


class Command(click.Command):
    """A command of the program; its help ends with examples, and it takes `-q` and `-v`.

    Parameters
    ----------
    examples
        Command lines that the help shows.
    """

    def __init__(self, *arguments: Any, examples: Sequence[str] = (), **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.examples = examples
        self.params += [_verbosity_option("quiet"), _verbosity_option("verbose")]
        # click cuts only summaries that are not given.
        self.short_help = re.split(r"(?<=\.)\s", (self.help or "").strip())[0]

    def format_options(self, context: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options under their headings, and the examples."""
        records = {
            parameter.opts[-1]: record
            for parameter in self.get_params(context)
            if (record := parameter.get_help_record(context))
        }
        for heading, names in HEADINGS.items():
            rows = [records[name] for name in names if name in records]
            if rows:
                with formatter.section(heading):
                    formatter.write_dl(rows)
        if self.examples:
            with formatter.section("Examples"):
                for line in self.examples:
                    formatter.write(f"{'':{formatter.current_indent}}{line}\n")


class LazyGroup(click.Group):
    """A group that imports the module of a command when it is asked for: the program starts sooner.

    Parameters
    ----------
    modules
        The module of each command, by the command's name. In it the command has this name too, with
        underscores.
    """

    def __init__(self, *arguments: Any, modules: Mapping[str, str], **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._modules = modules

    def list_commands(self, context: click.Context) -> list[str]:
        """Return the names of all commands in the order of the alphabet."""
        return sorted([*super().list_commands(context), *self._modules])

    def get_command(self, context: click.Context, name: str) -> click.Command | None:
        """Return a command; None if there is none of that name."""
        if name not in self._modules:
            return super().get_command(context, name)
        module = import_module(self._modules[name])
        command: click.Command = getattr(module, name.replace("-", "_"))
        return command

    def resolve_command(
        self, context: click.Context, words: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command that the words begin with; an unknown name gets a suggestion."""
        try:
            return super().resolve_command(context, words)
        except click.UsageError as error:
            close = get_close_matches(words[0], self.list_commands(context), 1)
            if not close:
                raise
            message = f"No such command '{words[0]}'. Did you mean '{close[0]}'?"
            raise click.UsageError(message, context) from error


def _verbosity_option(name: str) -> click.Option:
    """Return `--quiet` or `--verbose`, which mean the same as before the command."""

    def apply(context: click.Context, _: click.Parameter, given: bool) -> None:
        if given and name == "quiet":
            context.obj = True
        if given:
            set_up_logs(verbose=name == "verbose", quiet=bool(context.obj))

    helps = {
        "quiet": "Print no progress and no warnings, only errors.",
        "verbose": "Print more about what is done.",
    }
    return click.Option(
        [f"-{name[0]}", f"--{name}"],
        is_flag=True,
        expose_value=False,
        callback=apply,
        help=helps[name],
    )

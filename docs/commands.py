"""Write docs/commands.md: the help of every command."""

import re
from collections.abc import Iterator
from pathlib import Path

import click

from vdet.cli.command import cli

PAGE = Path(__file__).with_name("commands.md")

_INTRODUCTION = """# Commands

The help of every command, written by `make commands`. All commands also have `-q`, `-v` and `-h`,
and all but `calibrate`, `demo` and `eval counts` have `-c` and `--set`: see `vdet config`. Those
that write files have `--overwrite`, which replaces existing outputs, and those that find vehicles
have `--model FILE` (`detector.model`), a .npz or .onnx, which determines the detector.
"""

_WITH_ALL_OPTIONS = ("vdet", "vdet config")
_COMMON_OPTION = re.compile(
    r"^  (?:-[qvhc], --\w+|--(?:set|overwrite|model) ).*\n(?: {4,}.*\n)*", re.MULTILINE
)
_EMPTY_SECTION = re.compile(r"^\w[\w ]*:\n(?:\n|\Z)", re.MULTILINE)


def commands_page() -> str:
    """Return the page as Markdown."""
    context = click.Context(cli, info_name="vdet", terminal_width=80, **cli.context_settings)
    texts = [(name, _without_common_options(name, text)) for name, text in _helps(cli, context)]
    return _INTRODUCTION + "".join(f"\n## {name}\n\n```text\n{text}\n```\n" for name, text in texts)


def _without_common_options(name: str, text: str) -> str:
    """Return the help of a command without the options that nearly all commands share."""
    if name in _WITH_ALL_OPTIONS:
        return text
    return _EMPTY_SECTION.sub("", _COMMON_OPTION.sub("", f"{text}\n")).rstrip("\n")


def _helps(command: click.Command, context: click.Context) -> Iterator[tuple[str, str]]:
    """Yield the name and the help of a command, and of each of its commands."""
    yield context.command_path, command.get_help(context)
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            subcommand = command.get_command(context, name)
            assert subcommand is not None
            yield from _helps(subcommand, click.Context(subcommand, info_name=name, parent=context))


if __name__ == "__main__":
    PAGE.write_text(commands_page(), encoding="utf-8")

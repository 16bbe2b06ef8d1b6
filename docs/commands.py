"""Write docs/commands.md: the help of every command."""

from collections.abc import Iterator
from pathlib import Path

import click

from vdet.cli.main import cli

PAGE = Path(__file__).with_name("commands.md")

_INTRODUCTION = """# Commands

The help of every command, as `vdet COMMAND --help` prints it. `make commands` writes this page.
"""


def commands_page() -> str:
    """Return the page as Markdown."""
    context = click.Context(cli, info_name="vdet", terminal_width=80, **cli.context_settings)
    texts = [f"\n## {name}\n\n```text\n{text}\n```\n" for name, text in _helps(cli, context)]
    return _INTRODUCTION + "".join(texts)


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

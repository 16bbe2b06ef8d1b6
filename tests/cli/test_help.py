"""The help of every command reads for itself."""

import re
import shlex
from collections.abc import Iterator

import click
import pytest

from conftest import Run
from vdet.cli.command import cli


def commands(group: click.Group, *names: str) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """Give every command with the words by which it is called, groups included."""
    yield names, group
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        if isinstance(command, click.Group):
            yield from commands(command, *names, name)
        else:
            yield (*names, name), command


COMMANDS = dict(commands(cli))
OPTIONS = [
    (names, option.opts[-1], option.help or "")
    for names, command in COMMANDS.items()
    for option in command.params
    if isinstance(option, click.Option)
]


@pytest.mark.parametrize("names", COMMANDS, ids=" ".join)
def test_the_help_shows_every_option_and_examples_that_can_be_run(
    run: Run, names: tuple[str, ...]
) -> None:
    command = COMMANDS[names]
    shown = run(*names, "--help", code=0).out
    assert command.help
    assert all(option.help for option in command.params if isinstance(option, click.Option))
    assert "..." not in re.sub(r"[A-Z]\]?\.\.\.", "", shown), "a line is cut"
    for parameter in command.params:
        is_flag = isinstance(parameter, click.Option) and parameter.is_flag
        assert is_flag or parameter.metavar, parameter.name
        row = rf"^  (-\w, )?{parameter.opts[-1]}\b"
        assert isinstance(parameter, click.Argument) or re.search(row, shown, re.MULTILINE)
    examples = re.findall(r"^    (vdet .*)$", shown, re.MULTILINE)
    assert examples or isinstance(command, click.Group)
    for example in examples:
        words = shlex.split(example.partition(" > ")[0])
        assert words[: 1 + len(names)] == ["vdet", *names]
        command.make_context(example, words[1 + len(names) :])


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (("detct-video", "in.mp4"), "detect-video"),
        (("eval", "vidoe"), "video"),
        (("demo", "--overwite"), "--overwrite"),
    ],
)
def test_a_command_or_option_that_does_not_exist_gets_a_suggestion(
    run: Run, words: tuple[str, ...], meant: str
) -> None:
    result = run(*words)
    assert result.code == 2
    assert "Did you mean" in result.err
    assert f"'{meant}'" in result.err


def test_one_option_means_the_same_in_every_command() -> None:
    """Options of one name have one help, except for what belongs to the command."""
    differing = {"--output", "--stages", "--json", "--jobs", "--page"}
    texts: dict[str, set[str]] = {}
    for _, option, text in OPTIONS:
        texts.setdefault(option, set()).add(text)
    assert {option for option, helps in texts.items() if len(helps) > 1} == differing

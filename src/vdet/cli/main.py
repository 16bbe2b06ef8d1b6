"""The program: its commands, and the one place where errors become text and exit codes."""

import os
import sys
import traceback
from collections.abc import Iterable, Sequence
from typing import NoReturn

import click

from vdet.cli.command import Command, LazyGroup
from vdet.cli.messages import print_lines, set_up_logs
from vdet.cli.options import read_settings, settings_options
from vdet.config.rendering import render
from vdet.errors import INTERRUPTED, ConfigError, VdetError, in_one_line
from vdet.files import escaped
from vdet.version import __version__

_COMMANDS = (
    *("calibrate", "count", "demo", "detect-image", "detect-video", "doctor", "info", "mine"),
    *("train", "train-net"),
)
_EVALUATIONS = "images", "patches", "tracks", "video"


@click.group(
    cls=LazyGroup,
    modules={name: f"vdet.cli.{name.replace('-', '_')}" for name in _COMMANDS},
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(__version__, prog_name="vdet")
@click.option("-v", "--verbose", is_flag=True, help="Print more about what is done.")
@click.option("-q", "--quiet", is_flag=True, help="Print no progress and no warnings, only errors.")
@click.pass_context
def cli(context: click.Context, verbose: bool, quiet: bool) -> None:
    """Find and follow vehicles in road video on an ordinary CPU."""
    set_up_logs(verbose=verbose, quiet=quiet)
    context.obj = quiet


@cli.group(
    "eval",
    cls=LazyGroup,
    modules={name: f"vdet.cli.eval_{name}" for name in _EVALUATIONS},
    short_help="Measure detection, tracking or the classifier.",
)
def evaluate() -> None:
    """Measure detection, tracking or the classifier."""


@cli.command(
    cls=Command,
    examples=(
        "vdet config > my.yaml",
        "vdet config -c seed --set output.crf=18",
    ),
)
@settings_options("tracker.kind=rules")
def config(config_name: str | None, assignments: tuple[str, ...]) -> None:
    """Print the effective settings as commented YAML.

    Save them, change what you like, and give the file to a command with -c.
    """
    print_lines(*render(read_settings(config_name, assignments)).splitlines())


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the program and exit.

    Exit codes: 0 success, 1 an error, 2 wrong usage, 3 some files of a batch failed, 130
    interrupted. An error is one line on standard error; with `VDET_DEBUG=1` in the environment a
    traceback follows.
    """
    try:
        code = cli.main(arguments, prog_name="vdet", standalone_mode=False)
    except click.ClickException as error:
        error.message = escaped(error.message)  # type: ignore[misc]  # it may name a file
        error.show()
        sys.exit(error.exit_code)
    except (KeyboardInterrupt, click.Abort):
        sys.exit(_print_error(["interrupted"], INTERRUPTED))
    except BrokenPipeError:  # whoever read our output has ended
        _drop_unwritten()
        sys.exit(1)
    except Exception as error:
        code = error.exit_code if isinstance(error, VdetError) else VdetError.exit_code
        lines = error.args if isinstance(error, ConfigError) else [in_one_line(error)]
        sys.exit(_print_error(lines, code))
    sys.exit(code if isinstance(code, int) else 0)


def _print_error(lines: Iterable[str], code: int) -> int:
    print_lines(*(f"vdet: {line}" for line in lines), err=True)
    if os.environ.get("VDET_DEBUG") == "1":
        traceback.print_exc()
    _drop_unwritten()
    return code


def _drop_unwritten() -> None:
    """Drop what standard output does not take: Python would try it again as it ends."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())

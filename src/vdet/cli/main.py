"""The program: its commands, and the place where errors become messages and exit codes."""

import os
import sys
import traceback
from collections.abc import Iterable, Sequence

import click

from vdet.cli.command import Program, print_lines, set_up_logs, verbosity_options
from vdet.errors import INTERRUPTED, ConfigError, VdetError, escaped, in_one_line
from vdet.version import __version__

cli = Program(
    "vdet",
    help="Find and follow vehicles in road video on an ordinary CPU.",
    params=verbosity_options(),
    context_settings={"help_option_names": ["-h", "--help"], "show_default": True},
)
click.version_option(__version__, prog_name="vdet")(cli)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program, and return its exit code.

    The codes are in `vdet.errors`. An error is one line on standard error; with `VDET_DEBUG=1` in
    the environment a traceback follows.
    """
    set_up_logs()
    try:
        code = cli.main(arguments, prog_name="vdet", standalone_mode=False)
    except click.ClickException as error:
        if not isinstance(error, getattr(click.exceptions, "NoArgsIsHelpError", ())):
            error.message = escaped(error.message)  # type: ignore[misc]  # it may name a file
        error.show()
        return error.exit_code
    except (KeyboardInterrupt, click.Abort):
        return _print_error(["interrupted"], INTERRUPTED)
    except BrokenPipeError:  # the reader of our output has ended
        _drop_unwritten()
        return 1
    except Exception as error:
        code = error.exit_code if isinstance(error, VdetError) else VdetError.exit_code
        is_list = isinstance(error, ConfigError) and len(error.args) > 1
        lines = error.args if is_list else [in_one_line(error)]
        return _print_error(lines, code)
    return code if isinstance(code, int) else 0


def _print_error(lines: Iterable[str], code: int) -> int:
    print_lines(*(f"vdet: {line}" for line in lines), err=True)
    if os.environ.get("VDET_DEBUG") == "1":
        traceback.print_exc()
    _drop_unwritten()
    return code


def _drop_unwritten() -> None:
    """Drop output that cannot be written, or Python would try again at exit."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())

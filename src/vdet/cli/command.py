"""The program: its commands, what it prints, and where errors become messages and exit codes.

Lines, log records and progress bars do not garble one another. Other packages extend the program.
"""

import logging
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vdet.errors import INTERRUPTED, ConfigError, VdetError, escaped, in_one_line
from vdet.files import output_errors
from vdet.plugins import COMMANDS, built_in_names, load_plugin, plugin_names
from vdet.version import __version__
from vdet.workers import Advance, Progress, no_progress

if TYPE_CHECKING:
    from tqdm import tqdm

    from vdet.findings import Finding


LOG = logging.getLogger("vdet")


def print_lines(*lines: str, err: bool = False) -> None:
    """Print each text as one line, above any progress bar.

    Texts are escaped: a file name in them could forge a line, or control the terminal.

    Raises
    ------
    BrokenPipeError
        The reader of the stream has ended.
    OutputError
        It cannot be written for another reason.
    """
    name = Path("standard error" if err else "standard output")
    bars = sys.modules.get("tqdm")  # imported if there is a bar
    with bars.tqdm.external_write_mode() if bars else nullcontext(), output_errors(name):
        click.echo("\n".join(map(escaped, lines)), err=err)


def is_quiet() -> bool:
    """Return whether `--quiet` is set: only errors are logged."""
    return LOG.level >= logging.ERROR


def announce(*lines: str) -> None:
    """Print lines on standard error, unless `--quiet` is set."""
    if lines and not is_quiet():
        print_lines(*lines, err=True)


def announce_notes(name: "Path | str", findings: "Iterable[Finding]") -> None:
    """Print the notes about lines, and that nothing was found, among the findings about a file."""
    codes = "line", "nothing-found"
    notes = (item for item in findings if item.severity == "note" and item.code in codes)
    announce(*(f"vdet: note: {name}: {note}" for note in notes))


class _LogHandler(logging.Handler):
    """Prints log records as messages; warnings are marked."""

    def emit(self, record: logging.LogRecord) -> None:
        mark = "warning: " if record.levelno == logging.WARNING else ""
        print_lines(f"vdet: {mark}{record.getMessage()}", err=True)


def set_up_logs() -> None:
    """Print the warnings and errors that vdet logs; `--quiet` and `--verbose` change the level."""
    LOG.handlers = [_LogHandler()]
    LOG.propagate = False
    LOG.setLevel(logging.WARNING)
    # Messages of Pillow about damaged images are for developers.
    logging.getLogger("PIL").addHandler(logging.NullHandler())
    warnings.filterwarnings("ignore", module="PIL")


def _shows_bars() -> bool:
    return not is_quiet() and sys.stderr.isatty()


def progress_bar(**options: Any) -> "tqdm[Any]":
    """Return a bar, disabled with `--quiet`, or if standard error is not a terminal."""
    from tqdm import tqdm

    return tqdm(disable=not _shows_bars(), dynamic_ncols=True, **options)


@contextmanager
def progress_bars(unit: str) -> Iterator[Progress]:
    """Yield a function that ends the bar of the previous step and starts a new one.

    It takes the name of the step and its total. A step with a name and no total shows only its
    name, and disappears at its end. See `progress_bar` for when there is no bar.
    """
    if not _shows_bars():
        yield no_progress  # without tqdm
        return
    with ExitStack() as stack:

        def start(step: str, total: int | None) -> Advance:
            stack.close()
            is_named_only = total is None and bool(step)
            form = "{desc} …" if is_named_only else None
            bar = progress_bar(
                total=total, desc=step, unit=unit, leave=not is_named_only, bar_format=form
            )
            return stack.enter_context(bar).update

        yield start


def command() -> Callable[[Callable[..., Any]], click.Command]:
    """Return a decorator that makes a command of the program, with `-q` and `-v`."""

    def decorate(function: Callable[..., Any]) -> click.Command:
        made = click.command()(function)
        made.params += verbosity_options()
        return made

    return decorate


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

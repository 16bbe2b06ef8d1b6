"""Options shared by several commands, so that a flag has one meaning everywhere.

The values of options for settings and outputs are not passed to commands: `read_settings` and
`wanted_outputs` return them.

Parameters
----------
configs
    Read settings from a YAML file, or from a shipped one: default, svm, seed or project-camera. Can
    be repeated. Later files win.
model
    Detector model: .npz from vdet train, or .onnx. It determines which detector runs
    (`detector.model`).
class
    Keep only vehicles of this class, such as truck. Can be repeated (`classes`).
lanes
    Find and draw the lane (`lanes.enabled`).
start
    Start at this time, such as 90, 1:30 or 0:01:30.5.
end
    Stop before this time.
until
    Stop after this frame, counted from 1.
truths
    Ground truth: MOTChallenge, COCO, .csv or .jsonl. Repeat for each video.
counts
    Write counts at lines and zones: .csv has the events, .totals.csv, .wide.csv and .zones.csv have
    tables by interval, .json has everything. Can be repeated.
flows
    Write flows from one line or zone to another: .csv has a row for each interval, flow and class,
    .wide.csv has a row for each interval, with sums, .matrix.csv has a matrix, .json has the flows
    and the matrix. Can be repeated.
interval
    Interval of tables and charts, such as 5min, 15min or 1h (`traffic.interval`).
begin
    Start time of the video, such as '2026-05-01 07:00+02:00' (`input.begin`).
json_target
    Write the results to FILE. With -, to standard output, and the text to standard error.
page
    Write a report with charts, page.html, into DIR.
sink
    Write another output with the sink NAME. Can be repeated.
overwrite
    Replace existing outputs.
scheduler
    Address of a Dask scheduler, such as tcp://host:8786. Workers must see the files at the same
    paths.
"""

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.shell_completion import CompletionItem

from vdet.errors import ConfigError, OutputError
from vdet.files import check_output, record_input
from vdet.run.sinks import Output

if TYPE_CHECKING:
    from vdet.config.schema import Settings
    from vdet.evaluate.output import RunName


class _Input(click.Path):
    def convert(self, value: Any, option: Any, context: Any) -> Any:
        path = Path(super().convert(value, option, context))  # type: ignore[arg-type]
        record_input(path)
        return path


PATH = click.Path(path_type=Path)
"""A path; whether it exists is checked later."""
INPUT = _Input(path_type=Path)
"""The path of an input file, which no output may replace."""
POSITIVE = click.IntRange(1, 1_000_000_000)
PROCESSES = click.IntRange(1, 256)
"""Number of threads or processes."""
TIME_FORM = "[[HH:]MM:]SS"


F = TypeVar("F", bound=Callable[..., Any])

_TIME = re.compile(r"([0-9]{1,4}:){0,2}[0-9]{1,8}(\.[0-9]{1,9})?", re.ASCII)
_PAIR = re.compile(r"([1-9][0-9]{0,4})[x×]([1-9][0-9]{0,4})", re.ASCII | re.IGNORECASE)


def parse_time(text: str) -> Fraction:
    """Return a time in exact seconds: the type of an option. Raises `click.BadParameter`."""
    if not _TIME.fullmatch(text):
        raise click.BadParameter(
            f"{text!r} is not a time; expected seconds or HH:MM:SS, such as 1:23.5"
        )
    seconds = Fraction(0)
    for part in text.split(":"):
        seconds = seconds * 60 + Fraction(part)
    return seconds


def parse_pair(text: str) -> tuple[int, int]:
    """Return both numbers of a text such as 1280x720. Raises `click.BadParameter`."""
    match = _PAIR.fullmatch(text)
    if not match:
        raise click.BadParameter(f"{text!r} is not two numbers separated by x")
    return int(match[1]), int(match[2])


def option(shown: str, kind: Any = None, *, name: str = "", **more: Any) -> Callable[[F], F]:
    """Return a decorator that adds an option to a command: see `Command` for its help.

    Parameters
    ----------
    shown
        Flags and placeholder as shown in the help, such as "-o, --output FILE". An option without a
        value has no placeholder.
    kind
        Type of the value; None: the path of an input for the placeholder FILE, any path for DIR,
        otherwise text.
    name
        Argument of the command; by default the name of the option.
    more
        Further arguments of `click.option`.
    """
    words = [word.rstrip(",") for word in shown.split()]
    flags = [word for word in words if word.startswith("-")]
    metavar = " ".join(words[len(flags) :])
    if not metavar:
        more["is_flag"] = True
    elif kind is None:
        kind = {"FILE": INPUT, "DIR": PATH}.get(metavar)
    if "default" in more:
        more["show_default"] = True
    names = [*flags, *([name] if name else [])]
    return click.option(*names, type=kind, metavar=metavar or None, **more)


overwrite_option = option("--overwrite")
scheduler_option = option("--scheduler ADDRESS")
until_option = option("--until FRAME", POSITIVE, show_default="last frame of the ground truth")
truth_option = option("--truth FILE", name="truths", multiple=True)
start_option = option(f"--start {TIME_FORM}", parse_time)
end_option = option(f"--end {TIME_FORM}", parse_time)
jobs_option = option("--jobs N", PROCESSES, show_default="one per core")
output_file_option = option("-o, --output FILE", PATH, required=True)


def paired(videos: Sequence[Path], truths: Sequence[Path]) -> list[tuple[Path, Path]]:
    """Return each video with its ground truth. Raises `click.UsageError`."""
    if len(videos) != len(truths):
        given = f"videos: {len(videos)}, truths: {len(truths)}"
        raise click.UsageError(f"pass one --truth for each video ({given})")
    return list(zip(videos, truths, strict=True))


def check_file(output: Path, *suffixes: str, what: str, overwrite: bool) -> None:
    """Refuse an output with another suffix, or that cannot be written. Raises `OutputError`."""
    if output.suffix.lower() not in suffixes:
        raise OutputError(f"{output}: {what} must end in {suffixes[0]}")
    check_output(output, overwrite=overwrite)


def _keeping(what: str, make: Callable[[Any], Iterable[Any]] = list) -> dict[str, Any]:
    """Return arguments for `option` that store a value in `_kept` instead of passing it."""

    def keep(_: click.Context, __: click.Parameter, given: Any) -> None:
        if given not in (None, ()) and given is not False:
            _kept(what).extend(make(given))

    return {"expose_value": False, "callback": keep}


def _kept(what: str) -> list[Any]:
    kept: list[Any] = click.get_current_context().meta.setdefault(f"{__name__}.{what}", [])
    return kept


def short_form(
    shown: str, key: str, kind: Any = None, *, multiple: bool = False
) -> Callable[[F], F]:
    """Add an option that is a short form of a setting: see `read_settings`."""

    def assignments(given: Any) -> list[str]:
        return [f"{key}={json.dumps(given, default=str)}"]

    return option(shown, kind, multiple=multiple, **_keeping("short forms", assignments))


model_option = short_form("--model FILE", "detector.model")
class_option = short_form("--class NAME", "classes", str, multiple=True)
lanes_option = short_form("--lanes", "lanes.enabled")


def settings_options(example: str, *more: Callable[..., Any]) -> Callable[[F], F]:
    """Add `more` options, `-c FILE` and `--set KEY=VALUE`: see `read_settings`.

    `example` is an assignment for the help text that has an effect on the command.
    """
    config = option(
        "-c, --config FILE",
        str,
        name="configs",
        multiple=True,
        shell_complete=_complete_configs,
        **_keeping("configs"),
    )
    assign = option(
        "--set KEY=VALUE",
        help=f"Change one setting, for example {example}. Can be repeated.",
        multiple=True,
        shell_complete=_complete_keys,
        **_keeping("assignments"),
    )

    def add(command: F) -> F:
        for one in (assign, config, *more):
            command = one(command)
        return command

    return add


def read_settings(*, detector: str | None = None) -> "Settings":
    """Read the settings from the options of the running command: files, assignments, short forms.

    `detector` is the kind of detector if nothing else chooses one. Raises `ConfigError`.
    """
    assignments = (*_kept("assignments"), *_kept("short forms"))
    if not (_kept("configs") or assignments or detector):
        from vdet.config.schema import Settings

        return Settings()  # without YAML
    from vdet.config.loading import load_settings

    return load_settings(_config_files(), assignments, detector=detector)


def read_for_whole_frames(*, detector: str | None = None) -> "Settings":
    """Read settings for a command that uses whole frames; regions are a `ConfigError`."""
    settings = read_settings(detector=detector)
    if settings.regions:
        raise ConfigError("regions: this command uses whole frames; remove the regions")
    return settings


def _config_files() -> list[Path]:
    from vdet.config.loading import find_config

    return [find_config(name) for name in _kept("configs")]


def own_values() -> dict[str, Any]:
    """Return the values of files that are not shipped; see `given_values`."""
    from vdet.config.loading import given_values, shipped_configs

    shipped = set(shipped_configs().values())
    return given_values([path for path in _config_files() if path not in shipped])


def config_names() -> list[str]:
    """Return the settings files as the user named them."""
    return _kept("configs")


def run_name(settings: "Settings") -> "RunName":
    """Return a description of the detector that these settings select."""
    from vdet.detect.factory import model_file
    from vdet.evaluate.output import RunName

    detector, names = settings.detector, " ".join(config_names()) or None
    return RunName(detector.kind, model_file(detector), names, tuple(_kept("assignments")))


def _complete_configs(_: click.Context, __: click.Parameter, start: str) -> list[CompletionItem]:
    from vdet.config.loading import shipped_configs

    names = [name for name in shipped_configs() if name.startswith(start)]
    return [*map(CompletionItem, names), CompletionItem(start, type="file")]


def _complete_keys(_: click.Context, __: click.Parameter, start: str) -> list[str]:
    from vdet.config.schema import Settings

    keys = _keys(Settings().model_dump(mode="json"))
    return [f"{key}=" for key in keys if key.startswith(start)]


def _keys(values: Mapping[str, Any], before: str = "") -> Iterator[str]:
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _keys(value, f"{before}{name}.")
        else:
            yield f"{before}{name}"


def output_option(shown: str) -> Callable[[F], F]:
    """Add an option that requests the output of a sink: see `wanted_outputs`."""

    def outputs(given: Sequence[Path]) -> list[Output]:
        return [Output(shown.split(maxsplit=1)[0].lstrip("-"), path) for path in given]

    return option(shown, PATH, multiple=True, **_keeping("outputs", outputs))


def _parse_sink(text: str) -> Output:
    name, _, path = text.partition("=")
    if not (name and path):
        raise click.BadParameter(f"{text}: expected NAME=FILE, as in tracks=out.csv")
    return Output(name, Path(path))


sink_option = option("--sink NAME=FILE", _parse_sink, multiple=True, **_keeping("outputs"))


def wanted_outputs() -> list[Output]:
    """Return the outputs requested by options of the running command."""
    return list(_kept("outputs"))

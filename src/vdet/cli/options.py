"""Options that several commands share, so that one flag means one thing everywhere."""

import logging
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, TypeVar

import click
from click.shell_completion import CompletionItem

from vdet.cli.messages import print_lines, progress_steps
from vdet.config.kinds import kind_of_model
from vdet.config.loading import find_config, load_settings, shipped_configs
from vdet.config.schema import Settings
from vdet.errors import ConfigError
from vdet.files import staged, write_json
from vdet.lanes.camera_file import load_camera
from vdet.lanes.road import LaneRequest
from vdet.run.sinks.protocol import Output

PATH = click.Path(path_type=Path)
"""A path; whether something is there is checked later."""
POSITIVE = click.IntRange(1, 1_000_000_000)
PROCESSES = click.IntRange(1, 256)
"""How many threads or processes."""
TIME_FORM = "[[HH:]MM:]SS"

F = TypeVar("F", bound=Callable[..., Any])

log = logging.getLogger("vdet")

_OUTPUTS = f"{__name__}.outputs"
_LONGEST = 10_000 * 3600  # seconds
_TIME = re.compile(r"([0-9]{1,9}:){0,2}[0-9]{1,9}(\.[0-9]{1,9})?", re.ASCII)


class TimeType(click.ParamType):  # type: ignore[type-arg]  # generic from click 8.4 on
    """A time in the video: seconds, MM:SS or HH:MM:SS, each with decimals."""

    name = "time"

    def convert(
        self, value: Any, param: click.Parameter | None, context: click.Context | None
    ) -> Fraction:
        """Return the time in exact seconds."""
        if isinstance(value, Fraction):
            return value
        if not _TIME.fullmatch(str(value)):
            self.fail(
                f"{value!r} is no time; give seconds or HH:MM:SS, as in 1:23.5", param, context
            )
        seconds = Fraction(0)
        for part in str(value).split(":"):
            seconds = seconds * 60 + Fraction(part)
        if seconds > _LONGEST:
            self.fail(f"{value!r} is more than {_LONGEST // 3600:,} hours", param, context)
        return seconds


def settings_options(example: str) -> Callable[[F], F]:
    """Add `-c FILE` and `--set KEY=VALUE`; read them with `read_settings`.

    `example` is an assignment for the help text; it changes what the command does.
    """

    def add(command: F) -> F:
        command = click.option(
            "--set",
            "assignments",
            multiple=True,
            metavar="KEY=VALUE",
            shell_complete=_complete_keys,
            help=f"Change one setting, for example {example}. Can be repeated.",
        )(command)
        return click.option(
            "-c",
            "--config",
            "config_name",
            metavar="FILE",
            shell_complete=_complete_configs,
            help="Read settings from a YAML file, or from a shipped one: default, svm or seed.",
        )(command)

    return add


def _complete_configs(
    _: click.Context, __: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    names = [name for name in shipped_configs() if name.startswith(incomplete)]
    return [*map(CompletionItem, names), CompletionItem(incomplete, type="file")]


def _complete_keys(_: click.Context, __: click.Parameter, incomplete: str) -> list[str]:
    keys = _keys(Settings().model_dump(mode="json"))
    return [f"{key}=" for key in keys if key.startswith(incomplete)]


def _keys(values: Mapping[str, Any], before: str = "") -> Iterator[str]:
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _keys(value, f"{before}{name}.")
        else:
            yield f"{before}{name}"


def read_settings(
    config_name: str | None,
    assignments: tuple[str, ...],
    model_path: Path | None = None,
    *,
    regions: Path | None = None,
    lines: Path | None = None,
    detector: str | None = None,
) -> Settings:
    """Read the settings that `settings_options`, `regions_option` and `lines_option` ask for.

    The model file decides which detector runs; without one, `detector` is the kind, or the default
    where it is None.
    """
    if model_path is not None:
        detector = kind_of_model(model_path) or detector
    path = find_config(config_name) if config_name else None
    named = {"regions": regions, "counts": lines}
    places = {name: file for name, file in named.items() if file}
    return load_settings(path, assignments, places, detector=detector)


def read_whole_frame_settings(
    config_name: str | None,
    assignments: tuple[str, ...],
    model_path: Path | None = None,
    *,
    detector: str | None = None,
) -> Settings:
    """Read the settings of a command that looks at whole frames; arguments as of `read_settings`.

    Raises
    ------
    ConfigError
        They have regions, which would not have an effect.
    """
    settings = read_settings(config_name, assignments, model_path, detector=detector)
    if settings.regions:
        raise ConfigError("regions: this command looks at whole frames; leave the regions out")
    return settings


regions_option = click.option(
    "--regions",
    type=PATH,
    metavar="FILE",
    help="Search only these regions of the frame: polygons (.yaml), or a mask, which is a picture "
    "with the regions in white.",
)

lines_option = click.option(
    "--lines",
    type=PATH,
    metavar="FILE",
    help="Count at the lines and zones of this file (.yaml).",
)


model_option = click.option(
    "--model",
    "model_path",
    type=PATH,
    metavar="FILE",
    show_default="the shipped one that fits the settings",
    help="Model file of the detector: .npz, which vdet train wrote, or .onnx, a network. It "
    "decides which detector runs.",
)

sink_option = click.option(
    "--sink",
    "sinks",
    multiple=True,
    metavar="NAME=FILE",
    help="Write another output: the name of a sink, and a file. Can be repeated.",
)


def output_option(sink: str, metavar: str, help_text: str) -> Callable[[F], F]:
    """Add the option `--SINK PATH`, which asks for an output of this sink; see `read_sinks`."""

    def add(context: click.Context, _: click.Parameter, paths: tuple[Path, ...]) -> None:
        context.meta.setdefault(_OUTPUTS, []).extend(Output(sink, path) for path in paths)

    return click.option(
        f"--{sink}",
        type=PATH,
        multiple=True,
        metavar=metavar,
        expose_value=False,
        callback=add,
        help=help_text,
    )


def read_sinks(sinks: tuple[str, ...]) -> tuple[Output, ...]:
    """Read the outputs that each `output_option` of the command and `sink_option` ask for."""
    outputs: list[Output] = list(click.get_current_context().meta.get(_OUTPUTS, []))
    for text in sinks:
        name, equals, path = text.partition("=")
        if not (name and equals and path):
            raise click.UsageError(f"--sink {text}: expected NAME=FILE, as in tracks=out.csv")
        outputs.append(Output(name, Path(path)))
    return tuple(outputs)


def check_counts(outputs: Iterable[Output], settings: Settings) -> None:
    """Raise `click.UsageError` where counts are wanted, but there is nothing to count at."""
    if not settings.counts and any(output.sink == "counts" for output in outputs):
        raise click.UsageError("--counts needs lines or zones; give --lines FILE")


def lane_options(command: F) -> F:
    """Add `--lanes` and `--camera FILE`; read them with `read_lanes`."""
    command = click.option(
        "--camera",
        "camera_path",
        type=PATH,
        metavar="FILE",
        help="Undistort for --lanes with this file, which vdet calibrate wrote.",
    )(command)
    return click.option(
        "--lanes", is_flag=True, help="Find the lane too, and draw it into undistorted frames."
    )(command)


def read_lanes(lanes: bool, camera_path: Path | None) -> LaneRequest | None:
    """Read the request that `lane_options` make; None for no lanes."""
    if camera_path is not None and not lanes:
        raise click.UsageError("--camera goes with --lanes")
    if not lanes:
        return None
    if camera_path is None:
        log.warning("--lanes without --camera: pictures are taken as undistorted")
        return LaneRequest()
    return LaneRequest(load_camera(camera_path))


overwrite_option = click.option(
    "--overwrite", is_flag=True, help="Replace outputs that are there already."
)

scheduler_option = click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Work on the Dask cluster of this scheduler, for example tcp://host:8786. All its workers "
    "must find the files under the same names.",
)


def results_options(command: F) -> F:
    """Add `--json FILE`, `--page DIR` and `--overwrite`; read them with `print_results`."""
    command = overwrite_option(command)
    command = click.option(
        "--page", type=PATH, metavar="DIR", help="Write page.html, with charts, into DIR."
    )(command)
    return click.option(
        "--json",
        "json_target",
        metavar="FILE",
        help="Write all numbers to FILE. With -, they go to standard output, and the table to "
        "standard error.",
    )(command)


@dataclass(frozen=True, slots=True)
class Facts:
    """What a command found out, as lines of text and as values for JSON."""

    lines: Sequence[str]
    values: Mapping[str, Any]


def facts_options(command: F) -> F:
    """Add `--json FILE` and `--overwrite`; give their values to `print_facts`."""
    return _json_option(overwrite_option(command), "what is found out")


def print_facts(facts: Facts, json_target: str | None, *, overwrite: bool) -> None:
    """Print facts, and write the JSON that `facts_options` ask for."""
    print_lines(*facts.lines, err=json_target == "-")
    if json_target is not None:
        write_json(facts.values, json_target, overwrite=overwrite)


def _json_option(command: F, what: str) -> F:
    return click.option(
        "--json",
        "json_target",
        metavar="FILE",
        help=f"Write {what} to FILE. With -, it goes to standard output, and the text to standard "
        "error.",
    )(command)


def print_results(
    lines: Iterable[str],
    values: Mapping[str, Any],
    make_page: Callable[[], str],
    *,
    json_target: str | None,
    page: Path | None,
    overwrite: bool,
) -> None:
    """Print the table, and write the files that `results_options` ask for."""
    to_stderr = json_target == "-"
    print_lines(*lines, err=to_stderr)
    if json_target is not None:
        write_json(values, json_target, overwrite=overwrite)
    if page is not None:
        from vdet.pages.render import PAGE_NAME, write_page

        with progress_steps("", quiet=click.get_current_context().obj) as steps:
            steps("writing the page", None)
            with staged(page / PAGE_NAME, overwrite=overwrite) as temporary:
                write_page(make_page(), temporary)
        print_lines("", f"{page / PAGE_NAME}: the page", err=to_stderr)

"""Options that several commands share, so that one flag means one thing everywhere.

A *bundle* adds several options to a command, which gets their values as one argument.
"""

import logging
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from fractions import Fraction
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click
from click.shell_completion import CompletionItem

from vdet.errors import ConfigError, OutputError

if TYPE_CHECKING:
    from vdet.config.schema import DetectorSettings, Settings
    from vdet.detect.protocol import DetectorModel
    from vdet.lanes.ground import GroundRequest
    from vdet.lanes.road import LaneRequest
    from vdet.run.sinks.protocol import Output

PATH = click.Path(path_type=Path)
"""A path; whether something is there is checked later."""
POSITIVE = click.IntRange(1, 1_000_000_000)
PROCESSES = click.IntRange(1, 256)
"""Number of threads or processes."""
RATE = click.FloatRange(min=0, min_open=True)
SHARE = click.FloatRange(0, 1)
TIME_FORM = "[[HH:]MM:]SS"

F = TypeVar("F", bound=Callable[..., Any])

log = logging.getLogger("vdet")

_LONGEST = 10_000 * 3600  # seconds
_TIME = re.compile(r"([0-9]{1,9}:){0,2}[0-9]{1,9}(\.[0-9]{1,9})?", re.ASCII)
_PAIR = re.compile(r"([1-9][0-9]{0,4})[x×]([1-9][0-9]{0,4})", re.ASCII | re.IGNORECASE)


def parse_time(text: str) -> Fraction:
    """Return a time in exact seconds: the type of an option. Raises `click.BadParameter`."""
    if not _TIME.fullmatch(text):
        raise click.BadParameter(f"{text!r} is not a time; give seconds or HH:MM:SS, as in 1:23.5")
    seconds = Fraction(0)
    for part in text.split(":"):
        seconds = seconds * 60 + Fraction(part)
    if seconds > _LONGEST:
        raise click.BadParameter(f"{text!r} is more than {_LONGEST // 3600:,} hours")
    return seconds


def parse_pair(text: str) -> tuple[int, int]:
    """Return both numbers of a text such as 1280x720. Raises `click.BadParameter`."""
    match = _PAIR.fullmatch(text)
    if not match:
        raise click.BadParameter(f"{text!r} is not two numbers with an x between them")
    return int(match[1]), int(match[2])


def bundle(name: str, make: type[Any], *options: Callable[..., Any]) -> Callable[[F], F]:
    """Return a decorator that adds options to a command.

    The command gets one argument, `name`: the dataclass `make` with the values of the options. Its
    fields are called as the options' values; one without an option keeps its default.
    """
    keys = [field.name for field in fields(make)]

    def add(command: F) -> F:
        @wraps(command)
        def call(*arguments: Any, **values: Any) -> Any:
            values[name] = make(**{key: values.pop(key) for key in keys if key in values})
            return command(*arguments, **values)

        decorated: Any = call
        for option in reversed(options):
            decorated = option(decorated)
        return decorated  # type: ignore[no-any-return]

    return add


def option(
    shown: str, text: str, kind: Any = None, *, name: str = "", **more: Any
) -> Callable[[F], F]:
    """Return a decorator that adds an option to a command.

    Parameters
    ----------
    shown
        Flags and placeholder of the value as the help shows them, as in "-o, --output FILE". An
        option without a value has no placeholder.
    text
        Its help.
    kind
        Type of the value; None for text, and for a path where the placeholder is FILE or DIR.
    name
        The argument of the command; by default called as the option.
    more
        Further arguments of `click.option`.
    """
    words = [word.rstrip(",") for word in shown.split()]
    flags = [word for word in words if word.startswith("-")]
    metavar = " ".join(words[len(flags) :])
    if not metavar:
        more["is_flag"] = True
    elif kind is None and metavar in ("FILE", "DIR"):
        kind = PATH
    if "default" in more:
        more["show_default"] = True
    names = [*flags, *([name] if name else [])]
    return click.option(*names, help=text, type=kind, metavar=metavar or None, **more)


overwrite_option = option("--overwrite", "Replace outputs that are there already.")
scheduler_option = option(
    "--scheduler ADDRESS",
    "Work on this Dask cluster, as tcp://host:8786. Its workers must see the files by their names.",
)
until_option = option(
    "--until FRAME",
    "End with this frame, counted from 1.",
    POSITIVE,
    show_default="the last one in the truth",
)
truth_option = option(
    "--truth FILE",
    "True boxes: MOTChallenge, KITTI, CVAT, COCO, YOLO, .csv or .jsonl. Repeat it for each video.",
    name="truths",
    multiple=True,
)
start_option = option(
    f"--start {TIME_FORM}", "Begin at this time, as in 90, 1:30 or 0:01:30.5.", parse_time
)
end_option = option(f"--end {TIME_FORM}", "Stop before this time.", parse_time)
model_option = option(
    "--model FILE",
    "Model of the detector: .npz from vdet train, or .onnx. It decides which detector runs.",
    name="model_path",
    show_default="the shipped one that fits the settings",
)
regions_option = option(
    "--regions FILE",
    "Show only vehicles in these regions: polygons (.yaml), or a mask, white in them.",
)
ground_option = option(
    "--ground FILE",
    "Points of the road in pixels and metres (.yaml), for distances and speeds.",
    name="ground_file",
)
lines_option = option("--lines FILE", "Lines and zones at which vehicles are counted (.yaml).")


def jobs_option(text: str) -> Callable[[F], F]:
    """Add `--jobs N`."""
    return option("--jobs N", text, PROCESSES, show_default="one for each core")


def output_file_option(text: str) -> Callable[[F], F]:
    """Add `-o FILE`, which is required."""
    return option("-o, --output FILE", text, required=True)


def check_suffix(output: Path, *suffixes: str, what: str) -> None:
    """Refuse an output with another suffix. Raises `OutputError`."""
    if output.suffix.lower() not in suffixes:
        raise OutputError(f"{output}: {what} are written as {suffixes[0]}; name it so")


@dataclass(frozen=True, slots=True)
class SettingsChoice:
    """The settings that `settings_options` choose, with the model file and the places."""

    config_name: str | None
    assignments: tuple[str, ...]
    model_path: Path | None = None
    regions: Path | None = None
    lines: Path | None = None
    ground_file: Path | None = None

    def read(self, *more: str, detector: str | None = None) -> "Settings":
        """Read them; `more` are further assignments.

        The model file decides which detector runs; without one it is `detector`, or the default
        where that is None. Raises `ConfigError`.
        """
        named = {"regions": self.regions, "counts": self.lines}
        places = {name: file for name, file in named.items() if file}
        given = self.config_name, self.assignments, more, places, self.model_path, detector
        if not any(given):
            from vdet.config.schema import Settings

            return Settings()
        from vdet.config.loading import find_config, kind_of_model, load_settings

        if self.model_path is not None:
            detector = kind_of_model(self.model_path) or detector
        path = find_config(self.config_name) if self.config_name else None
        return load_settings(path, (*self.assignments, *more), places, detector=detector)

    def ground(self) -> "GroundRequest | None":
        """Read the file of the ground; None without one. Raises `ConfigError`."""
        if self.ground_file is None:
            return None
        from vdet.lanes.ground import load_ground

        return load_ground(self.ground_file)

    def load_detector(self, settings: "DetectorSettings") -> "DetectorModel":
        """Load the detector.

        Raises
        ------
        ConfigError, ModelError
            It cannot be loaded.
        """
        from vdet.detect.factory import load_detector

        return load_detector(settings, self.model_path)

    def inputs(
        self,
        settings: "Settings",
        detector: "DetectorSettings | None" = None,
        camera: Path | None = None,
    ) -> list[Path]:
        """Return the files of these settings, the model file of a detector, and a camera file."""
        from vdet.detect.factory import model_file

        config: Path | None = None
        if self.config_name:
            from vdet.config.loading import find_config

            config = find_config(self.config_name)
        model = detector and model_file(detector, self.model_path)
        places = self.regions, self.lines, self.ground_file, settings.regions.mask
        return [Path(each) for each in (config, *places, model, camera) if each]

    def read_for_whole_frames(self, *more: str, detector: str | None = None) -> "Settings":
        """Read them for a command that looks at whole frames; refuse regions as a `ConfigError`."""
        settings = self.read(*more, detector=detector)
        if settings.regions:
            raise ConfigError("regions: this command looks at whole frames; leave the regions out")
        return settings


def settings_options(example: str, *more: Callable[..., Any]) -> Callable[[F], F]:
    """Add `-c FILE`, `--set KEY=VALUE` and `more` options: `choice`, a `SettingsChoice`.

    `example` is an assignment for the help text that changes what the command does.
    """
    config = option(
        "-c, --config FILE",
        "Read settings from a YAML file, or from a shipped one: default, svm or seed.",
        str,
        name="config_name",
        shell_complete=_complete_configs,
    )
    assign = option(
        "--set KEY=VALUE",
        f"Change one setting, for example {example}. Can be repeated.",
        name="assignments",
        multiple=True,
        shell_complete=_complete_keys,
    )
    return bundle("choice", SettingsChoice, *more, config, assign)


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


Wanted = tuple[str, Path]
"""An output that is asked for: the name of its sink, and its path."""

_WANTED = f"{__name__}.wanted"


def output_option(shown: str, text: str) -> Callable[[F], F]:
    """Add the option of a sink, which asks for an output: see `wanted_outputs`."""
    return option(shown, text, PATH, multiple=True, expose_value=False, callback=_want)


def _want(context: click.Context, option: click.Parameter, given: tuple[Any, ...]) -> None:
    wanted = [each if isinstance(each, tuple) else (option.name, each) for each in given]
    context.meta.setdefault(_WANTED, []).extend(wanted)


def _parse_sink(text: str) -> Wanted:
    name, _, path = text.partition("=")
    if not (name and path):
        raise click.BadParameter(f"{text}: expected NAME=FILE, as in tracks=out.csv")
    return name, Path(path)


sink_option = option(
    "--sink NAME=FILE",
    "Write another output: the name of a sink, and a file. Can be repeated.",
    _parse_sink,
    multiple=True,
    expose_value=False,
    callback=_want,
)


def wanted_outputs() -> list[Wanted]:
    """Return what each `output_option` and `sink_option` of the running command asks for."""
    return list(click.get_current_context().meta.get(_WANTED, []))


def as_outputs(wanted: Iterable[Wanted]) -> tuple["Output", ...]:
    """Return outputs as the library takes them."""
    from vdet.run.sinks.protocol import Output

    return tuple(Output(sink, path) for sink, path in wanted)


camera_option = option(
    "--camera FILE", "Correct the lens distortion by this file of vdet calibrate."
)


def lane_options(command: F) -> F:
    """Add `--lanes` and `--camera FILE`, for `read_lanes`."""
    add_lanes = option("--lanes", "Find the lane too, and draw it.")
    return add_lanes(camera_option(command))


def read_lanes(lanes: bool, camera: Path | None) -> "LaneRequest | None":
    """Return what `lane_options` ask for, None for no lanes; read the camera file."""
    if camera is not None and not lanes:
        raise click.UsageError("--camera goes with --lanes")
    if not lanes:
        return None
    from vdet.lanes.camera import load_camera
    from vdet.lanes.road import LaneRequest

    if camera is None:
        log.warning("--lanes without --camera: lens distortion is not corrected")
        return LaneRequest()
    return LaneRequest(load_camera(camera))

"""Options that several commands share, so that one flag means one thing everywhere."""

import logging
import re
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any, TypeVar

import click

from vdet.config.loading import find_config, load_settings
from vdet.config.schema import Settings
from vdet.lanes.camera_file import load_camera
from vdet.lanes.road import LaneRequest
from vdet.pipeline.sinks.protocol import Output

_TIME = re.compile(r"([0-9]{1,9}:){0,2}[0-9]{1,9}(\.[0-9]{1,9})?", re.ASCII)

F = TypeVar("F", bound=Callable[..., Any])

log = logging.getLogger("vdet")


class PathOf(click.Path):
    """A path, given to the command as `pathlib.Path`; whether it exists is the library's to say."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)


class Time(click.ParamType):  # type: ignore[type-arg]  # generic from click 8.4 on
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
        return seconds


def settings_options(command: F) -> F:
    """Add `-c FILE` and `--set KEY=VALUE`; read them with `read_settings`."""
    command = click.option(
        "--set",
        "assignments",
        multiple=True,
        metavar="KEY=VALUE",
        help="Change one setting, as in output.crf=18; may be given often.",
    )(command)
    return click.option(
        "-c",
        "--config",
        "config_name",
        metavar="FILE",
        help="YAML settings over the built-in ones: a file, or a shipped one (default, seed).",
    )(command)


def read_settings(config_name: str | None, assignments: tuple[str, ...]) -> Settings:
    """Read what `settings_options` gave."""
    return load_settings(find_config(config_name) if config_name else None, assignments)


def model_option(command: F) -> F:
    """Add `--model FILE`; load it with `load_detector`."""
    return click.option(
        "--model",
        "model_path",
        type=PathOf(),
        metavar="FILE",
        help="Model file of the detector; else the shipped one that fits the settings.",
    )(command)


def sink_option(command: F) -> F:
    """Add `--sink NAME=FILE`; read it with `read_sinks`."""
    return click.option(
        "--sink",
        "sinks",
        multiple=True,
        metavar="NAME=FILE",
        help="Another output, by the name of its sink; may be given often.",
    )(command)


def read_sinks(sinks: tuple[str, ...]) -> tuple[Output, ...]:
    """Read what `sink_option` gave."""
    outputs = []
    for text in sinks:
        name, equals, path = text.partition("=")
        if not (name and equals and path):
            raise click.UsageError(f"--sink {text}: expected NAME=FILE, as in tracks=out.csv")
        outputs.append(Output(name, Path(path)))
    return tuple(outputs)


def lane_options(command: F) -> F:
    """Add `--lanes` and `--camera FILE`; read them with `read_lanes`."""
    command = click.option(
        "--camera",
        "camera_path",
        type=PathOf(),
        metavar="FILE",
        help="Undistort with this camera, from vdet calibrate; goes with --lanes.",
    )(command)
    return click.option(
        "--lanes", is_flag=True, help="Find and draw the lane too, on undistorted pictures."
    )(command)


def read_lanes(lanes: bool, camera_path: Path | None) -> LaneRequest | None:
    """Read what `lane_options` gave."""
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
    help="Work on the Dask cluster of this scheduler, as tcp://host:8786; files lie where all its "
    "workers find them.",
)

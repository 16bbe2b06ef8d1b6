"""Options shared by several commands, so that a flag has one meaning everywhere, and results."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vdet.cli.command import print_lines
from vdet.errors import ConfigError
from vdet.files import FileIds, OutputFiles, json_text, output_errors, print_now, write_text
from vdet.run.sinks import Output

if TYPE_CHECKING:
    from vdet.config.loading import Document
    from vdet.config.schema import Settings
    from vdet.evaluate.results import Report

Function = Callable[..., Any]
"""A function that becomes a command."""
Paths = tuple[Path, ...]


PATH = click.Path(path_type=Path)
"""A path; whether it exists is checked later."""
POSITIVE = click.IntRange(1, 1_000_000_000)
PROCESSES = click.IntRange(1, 256)
"""Number of threads or processes."""

_TIME = re.compile(r"([0-9]{1,4}:){0,2}[0-9]{1,8}(\.[0-9]{1,9})?", re.ASCII)
_CHANGES = "vdet.changes"  # in the context of click: the settings that options change
_PAIR = re.compile(r"([1-9][0-9]{0,4})[x×]([1-9][0-9]{0,4})", re.ASCII | re.IGNORECASE)


def _parse_time(text: str) -> Fraction:
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


def _parse_sink(text: str) -> Output:
    name, _, path = text.partition("=")
    if not (name and path):
        raise click.BadParameter(f"{text}: expected NAME=FILE, as in tracks=out.csv")
    return Output(name, Path(path))


def setting_option(key: str, *names: str, **attributes: Any) -> Callable[[Function], Function]:
    """Return an option that changes the setting `key`, of commands with `settings_options`."""

    def keep(context: click.Context, option: click.Parameter, value: Any) -> None:
        if value is not None and value is not False and value != ():
            from vdet.config.loading import given

            plain = str(value) if isinstance(value, Path) else value
            changes = context.meta.setdefault(_CHANGES, [])
            changes.append(given(tuple(key.split(".")), plain, option.opts[0]))

    attributes["help"] += f" (`{key}`)."
    return click.option(*names, expose_value=False, callback=keep, **attributes)


input_file = partial(click.option, type=PATH, metavar="FILE")
output_file = partial(click.option, type=PATH, metavar="FILE")
output_folder = partial(click.option, type=PATH, metavar="DIR")
output_files = partial(output_file, multiple=True)
output_folders = partial(output_folder, multiple=True)
time_option = partial(click.option, type=_parse_time, metavar="[[HH:]MM:]SS")
number_option = partial(click.option, type=POSITIVE, metavar="N")
jobs_option = partial(number_option, "--jobs", type=PROCESSES, show_default="one per core")

counts_option = output_files(
    "--counts",
    help="Write counts at lines and zones: events (.csv), tables by interval (.totals.csv, "
    ".wide.csv, .zones.csv), everything (.json), or a workbook (.xlsx). Can be repeated.",
)
flows_option = output_files(
    "--flows",
    help="Write flows from one line or zone to another: .csv, .wide.csv (a row for each interval), "
    ".json (with the matrix), or the workbook (.xlsx). Can be repeated.",
)
interval_option = setting_option(
    "traffic.interval",
    "--interval",
    metavar="TIME",
    help="Interval of tables and charts, such as 5min, 15min or 1h",
)
begin_option = setting_option(
    "input.begin",
    "--begin",
    metavar="TIME",
    help="Start time of the video, such as '2026-05-01 07:00+02:00'",
)
corrections_option = input_file(
    "--corrections",
    "corrections",
    multiple=True,
    help="Correct the counts by a file that a reviewer saved. Can be repeated.",
)
sinks_option = output_files(
    "--sink",
    "sinks",
    type=_parse_sink,
    metavar="NAME=FILE",
    help="Write another output with the sink NAME. Can be repeated.",
)
tracks_from_option = partial(
    input_file,
    "--tracks-from",
    "tracks",
    help="Read the tracks from FILE instead of detecting vehicles.",
)
CLASS_HELP = "Keep only vehicles of this class, such as truck. Can be repeated"
classes_option = setting_option(
    "classes", "--class", metavar="NAME", multiple=True, help=CLASS_HELP
)
strict_option = click.option(
    "--strict", is_flag=True, help="Exit with code 4 if a result is doubtful."
)
overwrite_option = click.option("--overwrite", is_flag=True, help="Replace existing outputs.")
start_option = time_option("--start", help="Start at this time, such as 90, 1:30 or 0:01:30.5.")
end_option = time_option("--end", help="Stop before this time.")
truths_option = input_file(
    "--truth",
    "truths",
    multiple=True,
    help="Ground truth: MOTChallenge, COCO, .csv or .jsonl. Repeat for each video.",
)
until_option = number_option(
    "--until",
    metavar="FRAME",
    show_default="last frame of the ground truth",
    help="Stop after this frame, counted from 1.",
)
lanes_option = setting_option(
    "lanes.enabled", "--lanes", is_flag=True, help="Find and draw the lane"
)
model_option = setting_option(
    "detector.model",
    "--model",
    type=PATH,
    metavar="FILE",
    help="Detector model: .npz or .onnx. It determines the detector",
)

_OF_SEARCHES = "detector", "tracker", "steps", "lanes", "train", "labels", "clips", "draw"
"""Sections of settings that only runs use."""


@dataclass(frozen=True, slots=True)
class SettingsSource:
    """Where the settings of a command come from; later ones win.

    Attributes
    ----------
    configs
        Settings files, or the names of shipped ones.
    changes
        Texts such as `output.crf=18`.
    options
        The values of other options.
    """

    configs: Sequence[str] = ()
    changes: tuple[str, ...] = ()
    options: "tuple[Document, ...]" = ()

    @property
    def files(self) -> tuple[Path, ...]:
        """The settings files. Raises `ConfigError`."""
        if not self.configs:
            return ()
        from vdet.config.loading import find_config

        return tuple(find_config(name) for name in self.configs)

    def inputs(self, *paths: Path, settings: "Settings | None" = None) -> FileIds:
        """Identify the files that a command reads: see `vdet.run.images`.

        These are `paths`, the settings files, and the model file and masks of `settings`.
        """
        from vdet.run.images import input_files

        return input_files(*paths, *self.files, settings=settings)

    def check_for_tracks(self) -> None:
        """Raise `click.UsageError` if `--set` changes a section that saved tracks do not need."""
        for change in self.changes:
            if re.split("[.=]", change.strip())[0] in _OF_SEARCHES:
                raise click.UsageError(
                    f"--set {change}: changes nothing in saved tracks; remove it"
                )

    def load(self, *, detector: str | None = None) -> "Settings":
        """Read the settings; arguments and errors as for `load_settings`."""
        if not (self.configs or self.changes or self.options or detector):
            from vdet.config.schema import Settings

            return Settings()  # without YAML
        from vdet.config.loading import load_settings, parse_assignment

        changes = [parse_assignment(text, "--set") for text in self.changes]
        return load_settings(self.files, options=[*changes, *self.options], detector=detector)


def settings_options(command: Function) -> Function:
    """Add `-c FILE` and `--set KEY=VALUE`; the command receives all settings as `source`."""

    @click.option(
        "-c",
        "--config",
        "configs",
        metavar="FILE",
        multiple=True,
        help="Read settings from a YAML file, or from a shipped one: default, svm, seed, "
        "ahead or project-camera. Can be repeated. Later files win.",
    )
    @click.option(
        "--set",
        "assignments",
        metavar="KEY=VALUE",
        multiple=True,
        help="Change one setting, for example output.crf=18. Can be repeated.",
    )
    @wraps(command)
    def with_source(configs: tuple[str, ...], assignments: tuple[str, ...], **values: Any) -> Any:
        changes = click.get_current_context().meta.get(_CHANGES, ())
        return command(source=SettingsSource(configs, assignments, tuple(changes)), **values)

    return with_source


def reject_regions(settings: "Settings") -> None:
    """Raise `ConfigError` if there are regions: for commands that use whole frames."""
    if settings.regions:
        raise ConfigError("regions: this command uses whole frames; remove the regions")


def requested_outputs(sinks: Sequence[Output], paths: Mapping[str, Paths]) -> list[Output]:
    """Return the outputs in `paths`, by the names of their sinks, and `sinks` after them."""
    return [*(Output(name, path) for name, listed in paths.items() for path in listed), *sinks]


def check_counting(settings: "Settings", outputs: Sequence[Output], *, several: bool) -> None:
    """Raise `click.UsageError` if the settings do not fit the outputs, or several videos."""
    tables = {output.sink for output in outputs} & {"counts", "flows", "review"}
    if tables and not settings.traffic:
        raise click.UsageError(
            f"--{min(tables)} needs lines or zones; add a settings file with -c FILE"
        )
    if settings.input.begin and several:
        raise click.UsageError(
            "input.begin is for one video, or for vdet count; for several set a pattern of their "
            "names, camera.clock.pattern"
        )


def with_truths(videos: Sequence[Path], truths: Sequence[Path]) -> list[tuple[Path, Path]]:
    """Return each video with its ground truth. Raises `click.UsageError`."""
    if len(videos) != len(truths):
        numbers = f"videos: {len(videos)}, truths: {len(truths)}"
        raise click.UsageError(f"pass one --truth for each video ({numbers})")
    return list(zip(videos, truths, strict=True))


@dataclass(frozen=True, slots=True)
class ResultFiles:
    """Where a command writes its results: see `results_options`."""

    json_target: str | None
    overwrite: bool
    page: Path | None = None

    def check(self, inputs: FileIds) -> None:
        """Check that the outputs can be written, and are none of the inputs, before any work.

        Raises
        ------
        OutputError
            A file already exists (without `overwrite`), is an input, or cannot be written.
        """
        files = OutputFiles(overwrite=self.overwrite, inputs=inputs)
        for path in self._files.values():
            makes_folder = self.page is not None and self.page.is_relative_to(path.parent)
            files.check(path, makes_folder=makes_folder)

    @property
    def _files(self) -> dict[str, Path]:
        """The files to write, by kind."""
        from vdet.pages.render import PAGE_NAME

        files = {}
        if self.json_target is not None and self.json_target != "-":
            files["numbers"] = Path(self.json_target)
        if self.page:
            files["page"] = self.page / PAGE_NAME
        return files

    def print(
        self,
        lines: Iterable[str],
        values: Mapping[str, Any],
        make_page: Callable[[], str] = lambda: "",
    ) -> None:
        """Print lines of text, and write the files, which appear together. Raises `OutputError`."""
        to_stderr = self.json_target == "-"
        print_lines(*lines, err=to_stderr)
        with OutputFiles(overwrite=self.overwrite) as files:
            for kind, path in self._files.items():
                with output_errors(path):
                    text = make_page() if kind == "page" else json_text(values)
                    write_text(files.stage_folder(path.parent) / path.name, text)
            if to_stderr:
                print_now(json_text(values))
        if self.page:
            print_lines("", f"{self._files['page']}: written", err=to_stderr)

    def print_report(self, report: "Report") -> None:
        """Print and write the report of an evaluation, as `print` does."""
        self.print(report.lines, report.values, report.page)


def facts_options(command: Function) -> Function:
    """Add `--json FILE` and `--overwrite`; the command receives them as `results`."""

    @click.option(
        "--json",
        "json_target",
        metavar="FILE",
        help="Write the results to FILE, or with - to standard output.",
    )
    @overwrite_option
    @wraps(command)
    def with_results(
        json_target: str | None, overwrite: bool, page: Path | None = None, **values: Any
    ) -> Any:
        return command(results=ResultFiles(json_target, overwrite, page), **values)

    return with_results


def results_options(command: Function) -> Function:
    """Add `--page DIR` to `facts_options`."""
    page_option = output_folder("--page", help="Write a report with charts, page.html, into DIR.")
    return page_option(facts_options(command))

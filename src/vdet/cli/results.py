"""Where a command puts what it found out: text, JSON, a page, and tables of counts."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vdet.cli import options
from vdet.cli.messages import print_lines, progress_steps
from vdet.cli.options import F, bundle, option, overwrite_option, short_form
from vdet.errors import OutputError
from vdet.files import OutputFiles, check_output, json_text, output_errors, write_json, write_text

if TYPE_CHECKING:
    from vdet.config.schema import Settings


@dataclass(frozen=True, slots=True)
class Results:
    """Where a command puts what it measured: the values of `results_options`."""

    json_target: str | None
    overwrite: bool
    page: Path | None = None

    def check(self) -> None:
        """Refuse outputs that could not be written, before any work.

        Raises
        ------
        OutputError
            A file already exists (and not `overwrite`), is an input, or cannot be written; or
            both outputs are one file.
        """
        paths = [path for path in (self._json_file, self._page_file) if path]
        if len({path.resolve() for path in paths}) < len(paths):
            raise OutputError(f"{paths[0]}: is used for two outputs; rename one")
        for path in paths:
            makes_folder = self.page is not None and self.page.is_relative_to(path.parent)
            check_output(path, overwrite=self.overwrite, makes_folder=makes_folder)

    @property
    def _json_file(self) -> Path | None:
        return None if self.json_target in (None, "-") else Path(str(self.json_target))

    @property
    def _page_file(self) -> Path | None:
        if self.page is None:
            return None
        from vdet.pages.render import PAGE_NAME

        return self.page / PAGE_NAME

    def print(
        self,
        lines: Iterable[str],
        values: Mapping[str, Any],
        make_page: Callable[[], str] = lambda: "",
    ) -> None:
        """Print lines of text, and write the files, which appear together. Raises `OutputError`."""
        to_stderr = self.json_target == "-"
        print_lines(*lines, err=to_stderr)
        texts: dict[Path, str] = {}
        if self._json_file:
            texts[self._json_file] = json_text(values)
        if self._page_file:
            with progress_steps("") as steps:
                steps("writing the page", None)
                texts[self._page_file] = make_page()
        with OutputFiles(overwrite=self.overwrite) as files:
            for path, text in texts.items():
                with output_errors(path):
                    write_text(files.stage_folder(path.parent) / path.name, text)
            if to_stderr:
                write_json(values, "-")
        if self._page_file:
            print_lines("", f"{self._page_file}: the page", err=to_stderr)


_json_option = option(
    "--json FILE",
    "Write the results to FILE. With -, to standard output, and the text to standard error.",
    str,
    name="json_target",
)
_page_option = option("--page DIR", "Write a report with charts, page.html, into DIR.")

facts_options = bundle("results", Results, _json_option, overwrite_option)
"""`--json FILE` and `--overwrite`."""

results_options = bundle("results", Results, _json_option, _page_option, overwrite_option)
"""`--json FILE`, `--page DIR` and `--overwrite`."""


def check_counting(settings: "Settings", *, several: bool) -> None:
    """Raise `click.UsageError` where settings do not fit the outputs or the videos."""
    wanted = {sink for sink, _ in options.wanted_outputs()}
    tables = wanted & {"counts", "flows"}
    if tables and not settings.traffic:
        raise click.UsageError(
            f"--{min(tables)} needs lines or zones; add a settings file with -c FILE"
        )
    if settings.input.begin and several:
        raise click.UsageError(
            "input.begin is for one video; for several set a pattern of their names, "
            "camera.clock.pattern"
        )


def counting_options(more: str = "") -> Callable[[F], F]:
    """Add `--counts`, `--flows`, and the short forms `--interval` and `--begin`.

    `more` ends the help of both outputs.
    """
    counts = options.output_option(
        "--counts FILE",
        "Write counts at lines and zones: .csv has the events, .totals.csv, .wide.csv and "
        ".zones.csv have tables by interval, .json has everything. Can be repeated." + more,
    )
    flows = options.output_option(
        "--flows FILE",
        "Write flows from one line or zone to another: .csv has a row for each interval, flow and "
        "class, .wide.csv has a row for each interval, with sums, .matrix.csv has a matrix, .json "
        "has the flows and the matrix. Can be repeated." + more,
    )
    interval = short_form(
        "--interval TIME",
        "traffic.interval",
        "Interval of tables and charts, such as 5min, 15min or 1h.",
    )
    begin = short_form(
        "--begin TIME", "input.begin", "Start time of the video, such as '2026-05-01 07:00+02:00'."
    )
    return lambda command: counts(flows(interval(begin(command))))

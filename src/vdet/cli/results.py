"""Where a command writes its results: text, JSON and a page; options for counting."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import click

from vdet.cli import options
from vdet.cli.messages import print_lines, progress_steps
from vdet.cli.options import F, option, overwrite_option, short_form
from vdet.errors import OutputError
from vdet.files import OutputFiles, check_output, json_text, output_errors, print_now, write_text

if TYPE_CHECKING:
    from vdet.config.schema import Settings
    from vdet.evaluate.report import Report


@dataclass(frozen=True, slots=True)
class ResultFiles:
    """Where a command writes its results, from the values of `results_options`."""

    json_target: str | None
    overwrite: bool
    page: Path | None = None

    def checked(self) -> Self:
        """Return self, after checking that the outputs can be written, before any work.

        Raises
        ------
        OutputError
            A file already exists (without `overwrite`), is an input, or cannot be written, or both
            outputs are the same file.
        """
        paths = list(self._files.values())
        if len({path.resolve() for path in paths}) < len(paths):
            raise OutputError(f"{paths[0]}: is used for two outputs; rename one")
        for path in paths:
            makes_folder = self.page is not None and self.page.is_relative_to(path.parent)
            check_output(path, overwrite=self.overwrite, makes_folder=makes_folder)
        return self

    @property
    def _files(self) -> dict[str, Path]:
        """The files to write, by kind."""
        from vdet.pages.render import PAGE_NAME

        page = self.page and self.page / PAGE_NAME
        targets = {"numbers": self.json_target, "page": page}
        return {what: Path(to) for what, to in targets.items() if to not in (None, "-")}

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
            for what, path in self._files.items():
                with progress_steps("") as steps, output_errors(path):
                    steps(f"writing the {what}", None)
                    text = make_page() if what == "page" else json_text(values)
                    write_text(files.stage_folder(path.parent) / path.name, text)
            if to_stderr:
                print_now(json_text(values))
        if self.page:
            print_lines("", f"{self._files['page']}: written", err=to_stderr)

    def print_report(self, report: "Report") -> None:
        """Print and write the report of an evaluation, as `print` does."""
        self.print(report.lines, report.values, report.page)


_json_option = option("--json FILE", str, name="json_target")
_page_option = option("--page DIR")


def facts_options(command: F) -> F:
    """Add `--json FILE` and `--overwrite`: arguments of `ResultFiles`."""
    return _json_option(overwrite_option(command))


def results_options(command: F) -> F:
    """Add `--json FILE`, `--page DIR` and `--overwrite`: arguments of `ResultFiles`."""
    return _json_option(_page_option(overwrite_option(command)))


def check_counting(settings: "Settings", *, several: bool) -> None:
    """Raise `click.UsageError` if the settings do not fit the outputs or the videos."""
    tables = {output.sink for output in options.wanted_outputs()} & {"counts", "flows"}
    if tables and not settings.traffic:
        raise click.UsageError(
            f"--{min(tables)} needs lines or zones; add a settings file with -c FILE"
        )
    if settings.input.begin and several:
        raise click.UsageError(
            "input.begin is for one video; for several set a pattern of their names, "
            "camera.clock.pattern"
        )


def counting_options(command: F) -> F:
    """Add `--counts`, `--flows`, and the short forms `--interval` and `--begin`."""
    counts, flows = map(options.output_option, ("--counts FILE", "--flows FILE"))
    interval = short_form("--interval TIME", "traffic.interval")
    return counts(flows(interval(short_form("--begin TIME", "input.begin")(command))))

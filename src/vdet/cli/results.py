"""Where a command writes its results: text, JSON and a page."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vdet.cli.messages import print_lines
from vdet.cli.options import Function, output_folder, overwrite_option
from vdet.files import OutputFiles, json_text, output_errors, print_now, write_text

if TYPE_CHECKING:
    from vdet.evaluate.report import Report
    from vdet.files import FileIds


@dataclass(frozen=True, slots=True)
class ResultFiles:
    """Where a command writes its results: see `results_options`."""

    json_target: str | None
    overwrite: bool
    page: Path | None = None

    def check(self, inputs: "FileIds") -> None:
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
        help="Write the results to FILE. With -, to standard output, and the text to standard "
        "error.",
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

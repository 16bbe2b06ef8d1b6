"""Where a command puts what it found out: text, JSON and a page."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vdet.cli.messages import print_lines, progress_steps
from vdet.cli.options import bundle, option, overwrite_option
from vdet.files import check_output, make_folder, write_json, write_whole


@dataclass(frozen=True, slots=True)
class Results:
    """Where a command puts what it measured: the values of `results_options`."""

    json_target: str | None
    overwrite: bool
    page: Path | None = None

    def check(self) -> None:
        """Refuse outputs that could not be written, before any work; make the folder of the page.

        Raises
        ------
        OutputError
            A file is there already (and not `overwrite`), or cannot be written.
        """
        if self.page is not None:
            from vdet.pages.render import PAGE_NAME

            make_folder(self.page)
            check_output(self.page / PAGE_NAME, overwrite=self.overwrite)
        if self.json_target not in (None, "-"):
            check_output(Path(str(self.json_target)), overwrite=self.overwrite)

    def print(
        self,
        lines: Iterable[str],
        values: Mapping[str, Any],
        make_page: Callable[[], str] = lambda: "",
    ) -> None:
        """Print lines of text, and write the files. Raises `OutputError`."""
        to_stderr = self.json_target == "-"
        print_lines(*lines, err=to_stderr)
        if self.json_target is not None:
            write_json(values, self.json_target, overwrite=self.overwrite)
        if self.page is not None:
            from vdet.pages.render import PAGE_NAME

            with progress_steps("") as steps:
                steps("writing the page", None)
                write_whole(self.page / PAGE_NAME, make_page(), overwrite=self.overwrite)
            print_lines("", f"{self.page / PAGE_NAME}: the page", err=to_stderr)


_json_option = option(
    "--json FILE",
    "Write the results to FILE. With -, they go to standard output, the text to standard error.",
    str,
    name="json_target",
)
_page_option = option("--page DIR", "Write page.html, with charts, into DIR.")

facts_options = bundle("results", Results, _json_option, overwrite_option)
"""`--json FILE` and `--overwrite`."""

results_options = bundle("results", Results, _json_option, _page_option, overwrite_option)
"""`--json FILE`, `--page DIR` and `--overwrite`."""

"""Where a command puts what it found out: text, JSON and a page."""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vdet.cli.messages import print_lines, progress_steps
from vdet.cli.options import bundle, option, overwrite_option
from vdet.errors import OutputError
from vdet.files import OutputFiles, check_output, output_errors, write_json, write_text


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
            texts[self._json_file] = json.dumps(values, indent=2, allow_nan=False) + "\n"
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
    "Write the results to FILE. With -, they go to standard output, the text to standard error.",
    str,
    name="json_target",
)
_page_option = option("--page DIR", "Write page.html, with charts, into DIR.")

facts_options = bundle("results", Results, _json_option, overwrite_option)
"""`--json FILE` and `--overwrite`."""

results_options = bundle("results", Results, _json_option, _page_option, overwrite_option)
"""`--json FILE`, `--page DIR` and `--overwrite`."""

"""Where results go: numbers to a file or standard output, a report into a folder."""

import importlib
from collections.abc import Iterable
from pathlib import Path

from vdet.errors import OutputError
from vdet.files import check_output, make_folder, replacing

PAGE = "report.html"


def check_outputs(
    json_target: str | None, report: Path | None, *, overwrite: bool, inputs: Iterable[Path]
) -> None:
    """Refuse, before any work, what could not be written; the folder of a report is made.

    `inputs` are the files that the work reads.

    Raises
    ------
    OutputError
        A file is there already (and not `overwrite`) or cannot be written; matplotlib, which
        draws the report, is not installed.
    """
    if json_target not in (None, "-"):
        check_output(Path(json_target), overwrite=overwrite, inputs=inputs)
    if report is not None:
        _check_matplotlib()
        make_folder(report)
        check_output(report / PAGE, overwrite=overwrite)


def write_page(html: str, folder: Path) -> Path:
    """Write a report into its folder and return the file. Raises `OutputError`."""
    with replacing(folder / PAGE) as temporary:
        temporary.write_text(html, encoding="utf-8")
    return folder / PAGE


def _check_matplotlib() -> None:
    try:
        importlib.import_module("matplotlib")
    except ImportError as error:
        raise OutputError('--report needs matplotlib; pip install "vdet[report]"') from error

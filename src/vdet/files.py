"""Output files that appear under their names only when complete."""

import contextlib
import json
import os
import secrets
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from vdet.errors import OutputError, VdetError


def check_output(path: Path, *, overwrite: bool, inputs: Iterable[Path] = ()) -> None:
    """Refuse an output that could not be written, before any work is done.

    Parameters
    ----------
    inputs
        Files that the work reads; they are never written over.

    Raises
    ------
    OutputError
        `path` is an input, is a folder, is there already (and not `overwrite`), or its folder
        cannot be written.
    """
    if path.resolve() in {source.resolve() for source in inputs}:
        raise OutputError(f"{path}: is the input itself; give another output")
    if path.is_dir():
        raise OutputError(f"{path}: is a folder; give the name of a file")
    if path.exists() and not overwrite:
        raise OutputError(f"{path}: is there already; give --overwrite to replace it")
    if not path.parent.is_dir():
        raise OutputError(f"{path}: the folder {path.parent} does not exist; make it first")
    if not os.access(path.parent, os.W_OK):
        raise OutputError(f"{path}: the folder {path.parent} cannot be written to")


def make_folder(folder: Path) -> None:
    """Make a folder, and those above it, where it is missing. Raises `OutputError`."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made a folder: {error.strerror}") from error


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary file beside `path`, renamed to `path` at the end, removed on an error.

    The temporary file keeps the suffix of `path`, for writers that choose a format by it.

    Raises
    ------
    OutputError
        The file cannot be made or renamed, or an `OSError` that is not a `VdetError` already
        came out of the block.
    """
    temporary = path.with_name(f".{path.stem}.{secrets.token_hex(4)}{path.suffix}")
    try:
        temporary.touch(exist_ok=False)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}") from error
    try:
        yield temporary
        temporary.replace(path)
    except BaseException as error:
        temporary.unlink(missing_ok=True)
        if isinstance(error, OSError) and not isinstance(error, VdetError):
            raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error
        raise


def write_json(values: Any, target: str) -> None:
    """Write to the file `target`, or to standard output for `-`. Raises `OutputError`."""
    text = json.dumps(values, indent=2, allow_nan=False) + "\n"
    if target == "-":
        sys.stdout.write(text)
        return
    with replacing(Path(target)) as temporary:
        temporary.write_text(text, encoding="utf-8")

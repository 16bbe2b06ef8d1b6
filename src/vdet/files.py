"""Output files that appear under their names only when complete."""

import contextlib
import json
import os
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from vdet.errors import OutputError, VdetError
from vdet.temporaries import bring_to_disk, remove_forsaken, temporary_beside


def check_output(
    path: Path, *, overwrite: bool, inputs: Iterable[Path] = (), makes_folder: bool = False
) -> None:
    """Refuse an output that could not be written, before any work is done.

    Parameters
    ----------
    inputs
        Files that the work reads; they are never written over.
    makes_folder
        The work makes the folder of the output if it is missing.

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
    folder = path.parent
    if makes_folder:
        folder = next((parent for parent in path.parents if parent.exists()), folder)
    if not folder.is_dir():
        missing = "is no folder" if folder.exists() else "does not exist; make it first"
        raise OutputError(f"{path}: the folder {folder} {missing}")
    if not os.access(folder, os.W_OK):
        raise OutputError(f"{path}: the folder {folder} cannot be written to")


def make_folder(folder: Path) -> None:
    """Make a folder, and those above it, where it is missing. Raises `OutputError`."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made a folder: {error.strerror}") from error


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary file beside `path`, renamed to `path` at the end, removed on an error.

    The temporary file keeps the suffix of `path`, for writers that choose a format by it. It is on
    the disk before it is renamed. Those that killed runs left in the folder are removed.

    Raises
    ------
    OutputError
        The file cannot be made or renamed, or an `OSError` that is not a `VdetError` already
        came out of the block.
    """
    remove_forsaken(path.parent)
    try:
        with temporary_beside(path) as temporary:
            yield temporary
            bring_to_disk(temporary)
            temporary.replace(path)
    except VdetError:
        raise
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error


def write_json(values: Any, target: str) -> None:
    """Write to the file `target`, or to standard output for `-`. Raises `OutputError`."""
    text = json.dumps(values, indent=2, allow_nan=False) + "\n"
    if target == "-":
        sys.stdout.write(text)
        return
    with replacing(Path(target)) as temporary:
        temporary.write_text(text, encoding="utf-8")

"""Files: outputs that appear only when they are complete, and inputs read up to a limit."""

import contextlib
import json
import os
import re
import stat
import sys
from collections.abc import Callable, Iterable, Iterator, Set
from pathlib import Path
from typing import Any, Self

from vdet.errors import OutputError, VdetError
from vdet.temporary import create_folder, remove_stale, sync, try_to_remove

_CHUNK = 1_000_000  # bytes
_ASIDE = ".older"  # folder in a temporary one, for files that are replaced


FileId = tuple[int, int]
"""Device and inode of a file: the same for all its names."""

MayReplace = Callable[[Path], bool]
"""Returns whether an existing file may be replaced, if the user asks for it."""


def any_file(_: Path) -> bool:
    """Allow every file to be replaced."""
    return True


def check_output(
    path: Path,
    *,
    overwrite: bool,
    inputs: Iterable[Path] = (),
    makes_folder: bool = False,
    may_replace: MayReplace = any_file,
) -> None:
    """Refuse an output that could not be written, before any work is done.

    Parameters
    ----------
    inputs
        Files that the work reads; they are never overwritten.
    makes_folder
        The work makes the folder of the output if it is missing.
    may_replace
        Called if `path` is there.

    Raises
    ------
    OutputError
        `path` is an input, is a folder, is there already (without `overwrite`) or may not be
        replaced, or its folder cannot be written to.
    """
    refuse_input(path, file_ids(inputs))
    if path.is_dir():
        raise OutputError(f"{path}: is a folder; give the name of a file")
    if os.path.lexists(path):
        _check_replaceable(path, may_replace)
        if not overwrite:
            raise OutputError(f"{path}: is there already; give --overwrite to replace it")
    folder = path.parent
    if makes_folder:
        folder = next((parent for parent in path.parents if parent.exists()), folder)
    if not folder.is_dir():
        missing = "is no folder" if folder.exists() else "does not exist; make it first"
        raise OutputError(f"{path}: the folder {folder} {missing}")
    if not os.access(folder, os.W_OK):
        raise OutputError(f"{path}: the folder {folder} cannot be written to")


def refuse_input(path: Path, inputs: Set[FileId]) -> None:
    """Raise `OutputError` if an output is one of the inputs."""
    if inputs and file_ids([path]) & inputs:
        raise OutputError(f"{path}: is the input itself; give another output")


def file_ids(paths: Iterable[Path]) -> set[FileId]:
    """Return the identities of the files that exist; links are followed."""
    ids = set()
    for path in paths:
        with contextlib.suppress(OSError):
            status = path.stat()
            ids.add((status.st_dev, status.st_ino))
    return ids


def _check_replaceable(path: Path, may_replace: MayReplace) -> None:
    if not (path.is_file() or path.is_symlink()):
        raise OutputError(f"{path}: is no ordinary file, and is kept; give another output")
    if not may_replace(path):
        raise OutputError(f"{path}: vdet did not write it, so it is kept; give another output")


def make_folder(folder: Path) -> None:
    """Make a folder, and those above it, where it is missing. Raises `OutputError`."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be made a folder: {error.strerror}") from error


class OutputFiles:
    """The output files of one run, which appear together; a context manager.

    When the block ends without an error, all staged files are synced to the disk and then get their
    names. When it ends with an error, or is interrupted, none appears, and every older file is as
    it was. Folders are made where they are missing.

    Parameters
    ----------
    overwrite
        Replace files that have these names, and keep their permissions. A link is replaced, and
        not what it leads to. Without it every file that is there is kept, also one that appears
        while the run writes.

    Raises
    ------
    OutputError
        A file cannot be made or synced, or cannot get its name, because there is one that is kept.
    """

    def __init__(self, *, overwrite: bool = False) -> None:
        self._overwrite = overwrite
        self._folders: dict[Path, Path] = {}  # temporary ones by where their files will go
        self._may_replace: dict[Path, MayReplace] = {}
        self._names: dict[Path, re.Pattern[str]] = {}
        self._new_folders: list[Path] = []
        self._cleanup = contextlib.ExitStack()

    def stage(self, path: Path, may_replace: MayReplace = any_file) -> Path:
        """Return a new, empty file of the same name that will become `path`.

        It lies in a temporary folder beside `path`. Temporary folders that killed runs left there
        are removed.

        Parameters
        ----------
        may_replace
            Called at the end if `path` is there and is to be overwritten.
        """
        with output_errors(path):
            temporary = self._temporary_folder(path.parent) / path.name
            temporary.touch()
        self._may_replace[path] = may_replace
        return temporary

    def stage_folder(self, path: Path, names: re.Pattern[str] | None = None) -> Path:
        """Return a folder whose files will lie in the folder `path`.

        If `path` is missing and the block ends with an error, it is not there afterwards.

        Parameters
        ----------
        names
            With `overwrite`, files of an earlier run are removed at the end: those in `path` with
            such names that this run did not write. None: all are kept.
        """
        is_new = not path.exists()
        with output_errors(path):
            temporary = self._temporary_folder(path)
        if is_new:
            self._new_folders.append(path)
        if names:
            self._names[path] = names
        return temporary

    def _temporary_folder(self, path: Path) -> Path:
        if path not in self._folders:
            path.mkdir(parents=True, exist_ok=True)
            remove_stale(path)
            self._folders[path] = create_folder(path, self._cleanup)
        return self._folders[path]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            with self._cleanup:
                if kind is None:
                    self._publish()
                    self._new_folders.clear()
        finally:
            for folder in self._new_folders:
                with contextlib.suppress(OSError):  # another run may have written into it
                    folder.rmdir()

    def _publish(self) -> None:
        files = {
            path / file.name: file
            for path, folder in self._folders.items()
            for file in sorted(folder.iterdir())
        }
        for path, file in files.items():
            with output_errors(path):
                sync(file)
        earlier = [
            old
            for path, names in (self._names.items() if self._overwrite else ())
            for old in path.iterdir()
            if names.fullmatch(old.name) and old not in files
        ]
        # An interrupt may come at any time, so how to undo a step is noted before the step.
        with contextlib.ExitStack() as undo:
            for path, file in files.items():
                with output_errors(path):
                    if self._overwrite and os.path.lexists(path):
                        _check_replaceable(path, self._may_replace.get(path, any_file))
                        if not path.is_symlink():
                            file.chmod(stat.S_IMODE(path.stat().st_mode))
                        self._set_aside(path, undo)
                        file.replace(path)
                    else:
                        _add_name(file, path, undo)
            for old in earlier:
                with contextlib.suppress(OSError):
                    self._set_aside(old, undo)
                    old.unlink(missing_ok=True)
            undo.pop_all()

    def _set_aside(self, path: Path, undo: contextlib.ExitStack) -> None:
        """Keep the file that is there in the temporary folder, under a second name if possible."""
        aside = self._folders[path.parent] / _ASIDE / path.name
        aside.parent.mkdir(exist_ok=True)
        undo.callback(_put_back, aside, path)
        try:
            os.link(path, aside, follow_symlinks=False)
        except OSError:  # a file system without hard links
            path.replace(aside)


def _put_back(aside: Path, path: Path) -> None:
    if os.path.lexists(aside):
        aside.replace(path)


def _add_name(temporary: Path, path: Path, undo: contextlib.ExitStack) -> None:
    """Give a file its final name, unless there is a file of this name; in one step of the system.

    Raises
    ------
    OutputError
        There is one.
    """
    undo.callback(_remove_if_same, path, temporary.stat())
    try:
        try:
            os.link(temporary, path)
        except FileExistsError:
            raise
        except OSError:  # a file system without hard links: an empty file takes the name
            path.touch(exist_ok=False)
            undo.callback(try_to_remove, path)
            temporary.replace(path)
    except FileExistsError:
        raise OutputError(f"{path}: has appeared during the run; give another output") from None


def _remove_if_same(path: Path, status: os.stat_result) -> None:
    with contextlib.suppress(OSError):
        if os.path.samestat(path.lstat(), status):
            path.unlink()


@contextlib.contextmanager
def staged(
    path: Path, *, overwrite: bool = False, may_replace: MayReplace = any_file
) -> Iterator[Path]:
    """Give a temporary file that becomes `path` when the block ends without an error.

    Raises
    ------
    OutputError
        The file cannot be made, or cannot get its name (see `OutputFiles`), or the block raises an
        `OSError` that is not a `VdetError`.
    """
    with OutputFiles(overwrite=overwrite) as files:
        temporary = files.stage(path, may_replace)
        with output_errors(path):
            yield temporary


@contextlib.contextmanager
def output_errors(path: Path) -> Iterator[None]:
    """Turn an `OSError` of the block into an `OutputError` that names `path`.

    A `BrokenPipeError` passes: whoever read the output has ended, and so does the program.
    """
    try:
        yield
    except (VdetError, BrokenPipeError):
        raise
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error


def write_text(path: Path, text: str) -> None:
    """Write UTF-8; what is no valid text, as a name of a file may be, is escaped."""
    path.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")


def write_whole(path: Path, text: str, *, overwrite: bool = False) -> None:
    """Write text that appears at `path` as a whole. Raises `OutputError`."""
    with staged(path, overwrite=overwrite) as temporary:
        write_text(temporary, text)


def print_now(text: str) -> None:
    """Write to standard output, so that an error comes here and not as Python ends."""
    sys.stdout.write(text)
    sys.stdout.flush()


def write_json(values: Any, target: str, *, overwrite: bool = False) -> None:
    """Write to the file `target`, or to standard output for `-`. Raises `OutputError`."""
    text = json.dumps(values, indent=2, allow_nan=False) + "\n"
    if target == "-":
        with output_errors(Path("standard output")):
            print_now(text)
        return
    write_whole(Path(target), text, overwrite=overwrite)


def read_whole(path: Path, *, most: int, what: str, error: type[VdetError]) -> bytes:
    """Return the content of a file.

    Parameters
    ----------
    most
        Bytes. A larger file is refused after `most` + 1 bytes, whatever size it claims.
    what
        What the file should be, for the message.
    error
        Raised where the file cannot be read, or is larger.
    """
    data = bytearray()
    try:
        with path.open("rb") as file:
            # A single read would set memory aside for all of `most`.
            while len(data) <= most and (chunk := file.read(min(_CHUNK, most + 1 - len(data)))):
                data += chunk
    except OSError as fault:
        raise error(f"{path}: cannot be read: {fault.strerror}") from fault
    if len(data) > most:
        raise error(f"{path}: is larger than {most:,} bytes; that is no {what}")
    return bytes(data)

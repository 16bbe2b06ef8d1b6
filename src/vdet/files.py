"""Files: outputs appear only when they are complete, and never replace an input.

Outputs are written into temporary folders beside their destination, named `.vdet-`, the host, and
16 digits. The writer holds a lock on its folder, which the system releases when the process ends,
however it ends. A shared file system may not show the locks of other hosts, so the files of a
killed run are removed by the next run on the same host.
"""

import contextlib
import json
import os
import platform
import re
import shutil
import stat
import sys
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from pathlib import Path
from typing import Any, Self

from vdet.errors import OutputError, VdetError
from vdet.system import locked_folder

_CHUNK = 1_000_000  # bytes
_HOST = re.sub(r"[^a-z0-9]", "", platform.node().lower())[:16]
_TEMPORARY = re.compile(rf"\.vdet-{_HOST}-[0-9a-f]{{16}}")
_ASIDE = ".older"  # folder in a temporary one, for files that are replaced

_FileId = tuple[int, int]  # device and inode: the same for all names of a file
_inputs: ContextVar[set[_FileId] | None] = ContextVar("inputs", default=None)


@contextlib.contextmanager
def recorded_inputs() -> Iterator[None]:
    """Record each file that is read in the block, so that no output of the block replaces one.

    A nested block shares the record of the outer one. Threads use the record of their context
    (`contextvars`), as those of `vdet.run.threads` do. Worker processes have none.
    """
    record = _inputs.get()
    token = _inputs.set(set() if record is None else record)
    try:
        yield
    finally:
        _inputs.reset(token)


def record_input(*files: Path | int) -> None:
    """Record files as inputs, by name or as descriptors; links are followed.

    All code that opens a file for reading calls this. A name can be recorded earlier, so that an
    output of this name is refused before any work.
    """
    record = _inputs.get()
    if record is not None:
        record.update(found for file in files if (found := _id(file)))


def is_input(path: Path) -> bool:
    """Return whether `path` is a file that this run reads: see `recorded_inputs`."""
    return _id(path) in (_inputs.get() or ())


def _id(file: Path | int) -> _FileId | None:
    try:
        status = os.stat(file)  # noqa: PTH116  # it may be a descriptor
    except OSError:  # it does not exist
        return None
    return status.st_dev, status.st_ino


def check_output(path: Path, *, overwrite: bool, makes_folder: bool = False) -> None:
    """Refuse an output that cannot be written, before any work is done.

    Parameters
    ----------
    makes_folder
        The folder of the output is created later if it is missing.

    Raises
    ------
    OutputError
        `path` is an input, a folder, or already exists (without `overwrite`), or its folder cannot
        be written to.
    """
    if os.path.isdir(path):  # noqa: PTH112  # a name that is too long fails later
        raise OutputError(f"{path}: is a folder; use the name of a file")
    folder = path.parent
    if makes_folder:
        folder = next((parent for parent in path.parents if os.path.exists(parent)), folder)  # noqa: PTH110
    if os.path.lexists(path):
        _check_replaceable(path)
        if not overwrite:
            raise OutputError(f"{path}: already exists; use --overwrite to replace it")
    if not folder.is_dir():
        problem = "is not a folder" if folder.exists() else "does not exist; create it first"
        raise OutputError(f"{path}: the folder {folder} {problem}")
    if not os.access(folder, os.W_OK):
        raise OutputError(f"{path}: the folder {folder} cannot be written to")


def _check_replaceable(path: Path) -> None:
    if is_input(path):
        raise OutputError(f"{path}: is the input itself; use another output")
    if not (path.is_file() or path.is_symlink()):
        raise OutputError(
            f"{path}: is not a regular file and will not be replaced; use another output"
        )


def make_folder(folder: Path) -> None:
    """Create a folder and its parents if they are missing. Raises `OutputError`."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be created: {error.strerror}") from error


class OutputFiles:
    """The output files of one run, which appear together; a context manager.

    When the block ends without an error, all staged files are synced to disk and then renamed, in
    the order in which their folders were staged. If it ends with an error or is interrupted, none
    appears, and every older file is unchanged. Missing folders are created, and removed again after
    an error.

    Parameters
    ----------
    overwrite
        Replace existing files, except inputs, and keep their permissions. A link itself is
        replaced, not its target. Otherwise every existing file is kept, also one that appears
        during the run.

    Raises
    ------
    OutputError
        A file cannot be created, synced or renamed, or an existing one must be kept.
    """

    def __init__(self, *, overwrite: bool = False) -> None:
        self._overwrite = overwrite
        self._folders: dict[Path, Path] = {}  # temporary folders by destination
        self._is_earlier: dict[Path, Callable[[Path], bool]] = {}
        self._new_folders: list[Path] = []  # outermost first
        self._cleanup = contextlib.ExitStack()

    def stage(self, path: Path) -> Path:
        """Return an empty temporary file of the same name that will become `path`.

        It is in a temporary folder beside `path`. Temporary folders left there by killed runs are
        removed.
        """
        with output_errors(path):
            temporary = self._temporary_folder(path.parent) / path.name
            temporary.touch()
        return temporary

    def stage_folder(self, path: Path, is_earlier: Callable[[Path], bool] | None = None) -> Path:
        """Return a temporary folder whose files will be moved to the folder `path`.

        Parameters
        ----------
        is_earlier
            Whether an earlier run wrote a file. With `overwrite`, the regular files in `path` for
            which it is true, and which this run did not write, are removed at the end. None: keep
            all.
        """
        if is_earlier:
            self._is_earlier[path] = is_earlier
        with output_errors(path):
            return self._temporary_folder(path)

    def place_of(self, path: Path) -> Path:
        """Return the temporary path of a staged file or folder."""
        folder = self._folders.get(path.parent, path.parent)
        return self._folders.get(path, folder / path.name)

    def _temporary_folder(self, path: Path) -> Path:
        if path not in self._folders:
            missing = [item for item in (path, *path.parents) if not item.exists()]
            self._new_folders += reversed(missing)
            path.mkdir(parents=True, exist_ok=True)
            remove_stale(path)
            self._folders[path] = _make_temporary(path, self._cleanup)
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
            for folder in reversed(self._new_folders):
                with contextlib.suppress(OSError):  # another run may have written into it
                    folder.rmdir()

    def _publish(self) -> None:
        files = {
            path / file.name: file
            for path, folder in self._folders.items()
            for file in sorted(folder.iterdir())
        }
        for path, file in files.items():
            with output_errors(path), file.open("rb+") as written:
                os.fsync(written.fileno())
        # New files are not inputs, although one may reuse the inode of a deleted input.
        (_inputs.get() or set()).difference_update(map(_id, files.values()))
        # An interrupt may come at any time, so the undo is registered before each step.
        with contextlib.ExitStack() as undo:
            for path, file in files.items():
                with output_errors(path):
                    if self._overwrite and os.path.lexists(path):
                        _check_replaceable(path)
                        if not path.is_symlink():
                            file.chmod(stat.S_IMODE(path.stat().st_mode))
                        self._set_aside(path, undo)
                    _add_name(path, file, undo)
            for folder, is_earlier in self._is_earlier.items() if self._overwrite else ():
                for old in list(folder.iterdir()):
                    is_removable = old not in files and old.is_file() and not old.is_symlink()
                    if is_removable and not is_input(old) and is_earlier(old):
                        with contextlib.suppress(OSError):
                            self._set_aside(old, undo)
            undo.pop_all()

    def _set_aside(self, path: Path, undo: contextlib.ExitStack) -> None:
        """Move the existing file into the temporary folder, which is removed at the end."""
        aside = self._folders[path.parent] / _ASIDE / path.name
        aside.parent.mkdir(exist_ok=True)
        undo.callback(_put_back, aside, path)
        path.replace(aside)


def _put_back(aside: Path, path: Path) -> None:
    if os.path.lexists(aside):
        aside.replace(path)


def _add_name(path: Path, file: Path, undo: contextlib.ExitStack) -> None:
    """Give a file its final name, atomically where the file system has hard links.

    Raises `OutputError` if another file has this name.
    """
    undo.callback(_remove_if_same, path, file.stat())
    try:
        os.link(file, path)
    except OSError:
        if os.path.lexists(path):
            raise OutputError(f"{path}: appeared during the run; use another output") from None
        file.replace(path)  # a file system without hard links


def _remove_if_same(path: Path, status: os.stat_result) -> None:
    with contextlib.suppress(OSError):
        if os.path.samestat(path.lstat(), status):
            path.unlink()


def _make_temporary(parent: Path, cleanup: contextlib.ExitStack) -> Path:
    """Create an empty, locked folder in `parent`; `cleanup` unlocks and removes it."""
    while True:
        folder = parent / f".vdet-{_HOST}-{os.urandom(8).hex()}"
        # An interrupt may come as soon as the folder exists.
        cleanup.callback(shutil.rmtree, folder, ignore_errors=True)
        parent.mkdir(parents=True, exist_ok=True)  # a failed run may have removed it
        with contextlib.suppress(FileNotFoundError, BlockingIOError):  # removed as stale
            folder.mkdir(0o700)  # private content stays private while it is written
            cleanup.enter_context(locked_folder(folder))
            folder.lstat()
            return folder


def remove_stale(folder: Path) -> None:
    """Remove the temporary folders in `folder` whose writers have ended."""
    with contextlib.suppress(OSError):
        for name in filter(_TEMPORARY.fullmatch, os.listdir(folder)):  # noqa: PTH208  # thousands
            with contextlib.suppress(OSError), locked_folder(folder / name) as is_locked:
                if is_locked:
                    shutil.rmtree(folder / name)


@contextlib.contextmanager
def staged(path: Path, *, overwrite: bool = False) -> Iterator[Path]:
    """Yield a temporary file that becomes `path` when the block ends without an error.

    Raises
    ------
    OutputError
        The file cannot be created or renamed (see `OutputFiles`), or the block raises an `OSError`
        that is not a `VdetError`.
    """
    with OutputFiles(overwrite=overwrite) as files:
        temporary = files.stage(path)
        with output_errors(path):
            yield temporary


@contextlib.contextmanager
def output_errors(path: Path) -> Iterator[None]:
    """Turn an `OSError` of the block into an `OutputError` that names `path`.

    A `BrokenPipeError` passes: the reader of the output has ended, and so does the program.
    """
    try:
        yield
    except (VdetError, BrokenPipeError):
        raise
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error


def write_text(path: Path, text: str) -> None:
    """Write UTF-8; invalid text, such as undecodable file names, is escaped."""
    path.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")


def write_whole(path: Path, text: str, *, overwrite: bool = False) -> None:
    """Write a text file that appears only when it is complete. Raises `OutputError`."""
    with staged(path, overwrite=overwrite) as temporary:
        write_text(temporary, text)


def print_now(text: str) -> None:
    """Write to standard output and flush, so that errors are raised here, as `OutputError`."""
    with output_errors(Path("standard output")):
        sys.stdout.write(text)
        sys.stdout.flush()


def json_text(values: Any, *, ensure_ascii: bool = True) -> str:
    """Return values as JSON, indented; only ASCII can be printed everywhere."""
    return json.dumps(values, indent=2, allow_nan=False, ensure_ascii=ensure_ascii) + "\n"


def read_whole(path: Path, *, limit: int, what: str, error: type[VdetError]) -> bytes:
    """Return the content of a file, and record it as an input.

    Parameters
    ----------
    limit
        Bytes. A larger file is refused after `limit` + 1 bytes, whatever size it claims.
    what
        What the file should be, for messages.
    error
        Type of the error to raise if the file cannot be read, or is larger.
    """
    data = bytearray()
    try:
        with path.open("rb") as file:
            record_input(file.fileno())
            # A single read would set memory aside for all of `limit`.
            while len(data) <= limit and (chunk := file.read(min(_CHUNK, limit + 1 - len(data)))):
                data += chunk
    except OSError as fault:
        raise error(f"{path}: cannot be read: {fault.strerror}") from fault
    if len(data) > limit:
        raise error(f"{path}: is larger than {limit:,} bytes, too large for a {what}")
    return bytes(data)

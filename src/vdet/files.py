"""Files: outputs appear only when they are complete, and never replace an input.

Outputs are written into temporary folders in the nearest folder of their destination that exists,
named `.vdet-`, the host, and 16 digits. The writer holds a lock on its folder, which the system
releases when the process ends, however it ends. A shared file system may not show the locks of
other hosts, so the files of a killed run are removed by the next run on the same host: nothing in a
temporary folder is the only copy of an older file.
"""

import contextlib
import fcntl
import json
import os
import platform
import re
import shutil
import signal
import sys
import threading
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from pathlib import Path, PurePath
from typing import Any, Self

from vdet.errors import OutputError, VdetError

_HOST = re.sub(r"[^a-z0-9]", "", platform.node().lower())[:16]
_TEMPORARY = re.compile(rf"\.vdet-{_HOST}-[0-9a-f]{{16}}")
_ASIDE = ".older"  # folder in a temporary one, for second names of files that are replaced

ENDING_SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
"""The signals that end the program: of Ctrl-C, of `kill`, and of a terminal that closes."""

FileIds = frozenset[tuple[int, int]]
"""Files by their device and inode, which are the same for all names of a file."""
NO_FILES: FileIds = frozenset()


def file_ids(paths: Iterable[Path]) -> FileIds:
    """Identify the files that exist; links are followed."""
    return frozenset(filter(None, map(_id, paths)))


def _id(path: Path) -> tuple[int, int] | None:
    try:
        status = path.stat()
    except OSError:  # it does not exist
        return None
    return status.st_dev, status.st_ino


def make_folder(folder: Path) -> None:
    """Create a folder and its parents if they are missing. Raises `OutputError`."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be created: {error.strerror}") from error


class OutputFiles:
    """The output files of one run, which appear together; a context manager.

    When the block ends without an error, all staged files are synced to disk and then renamed, in
    the order in which their folders were staged; missing folders are created. If it ends with an
    error or is interrupted, none appears, and every older file is unchanged. If the process is
    killed, each name still has its complete older or its complete new file. Without hard links,
    older files are copied for this.

    Parameters
    ----------
    overwrite
        Replace existing files, and keep their permissions. A link itself is replaced, not its
        target. Otherwise every existing file is kept, also one that appears during the run.
    inputs
        The files that the run reads, which are never replaced: see `vdet.run.images`.
    is_last
        The program writes nothing after these files: a signal to end it that comes while they are
        renamed, or later, is ignored. Without it, such a signal waits until they are renamed. A
        second one always acts at once.

    Raises
    ------
    OutputError
        A file cannot be created, synced or renamed, or an existing one must be kept.
    """

    def __init__(
        self, *, overwrite: bool = False, inputs: FileIds = NO_FILES, is_last: bool = False
    ) -> None:
        self._overwrite = overwrite
        self._inputs = inputs
        self._is_last = is_last
        self._claimed: set[Path] = set()
        self._folders: dict[Path, Path] = {}  # temporary folders by destination
        self._is_earlier: dict[Path, Callable[[Path], bool]] = {}
        self._cleanup = contextlib.ExitStack()

    def claim(self, path: Path) -> None:
        """Keep a path for one output. Raises `OutputError` if it is already that of another."""
        if path.resolve() in self._claimed:
            raise OutputError(f"{path}: is used for two outputs; rename one")
        self._claimed.add(path.resolve())

    def check(
        self,
        path: Path,
        *,
        suffixes: Sequence[str] = (),
        noun: str = "outputs",
        makes_folder: bool = False,
    ) -> None:
        """Check that an output can be written, before any work is done, and claim its path.

        Parameters
        ----------
        suffixes
            Allowed suffixes of its name, lower case; empty for any.
        noun
            Noun for such outputs in messages.
        makes_folder
            The folder of the output is created later if it is missing.

        Raises
        ------
        OutputError
            `path` has another suffix, is an input, a folder, another output, or already exists
            (without `overwrite`), or its folder cannot be written to.
        """
        self.claim(path)
        if suffixes and path.suffix.lower() not in suffixes:
            raise OutputError(f"{path}: {noun} must end in {', '.join(suffixes)}")
        if os.path.isdir(path):  # noqa: PTH112  # a name that is too long fails later
            raise OutputError(f"{path}: is a folder; use the name of a file")
        folder = path.parent
        if makes_folder:
            folder = next((parent for parent in path.parents if os.path.exists(parent)), folder)  # noqa: PTH110
        if os.path.lexists(path):
            self._check_replaceable(path)
            if not self._overwrite:
                raise OutputError(f"{path}: already exists", field="overwrite")
        if not folder.is_dir():
            problem = "is not a folder" if folder.exists() else "does not exist; create it first"
            raise OutputError(f"{path}: the folder {folder} {problem}")
        if not os.access(folder, os.W_OK):
            raise OutputError(f"{path}: the folder {folder} cannot be written to")

    def _check_replaceable(self, path: Path) -> None:
        if _id(path) in self._inputs:
            raise OutputError(f"{path}: is an input of this run; use another output")
        if not (path.is_file() or path.is_symlink()):
            raise OutputError(
                f"{path}: is not a regular file and will not be replaced; use another output"
            )

    def stage(self, path: Path) -> Path:
        """Return an empty temporary file of the same name that will become `path`.

        It is in a temporary folder. Temporary folders left by killed runs are removed.
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

    def staged_path(self, path: Path) -> Path:
        """Return the temporary path of a staged file or folder."""
        folder = self._folders.get(path.parent, path.parent)
        return self._folders.get(path, folder / path.name)

    def _temporary_folder(self, path: Path) -> Path:
        if path not in self._folders:
            # Each lock keeps a file open, so those of thousands of folders share one.
            outer = next(
                (self._folders[item] for item in path.parents if item in self._folders), None
            )
            if outer and outer.stat().st_dev == _existing(path).stat().st_dev:
                remove_stale(path)
                self._folders[path] = outer / f".{len(self._folders)}"
                self._folders[path].mkdir()
            else:
                self._folders[path] = _make_temporary(path, self._cleanup)
        return self._folders[path]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        with contextlib.ExitStack() as end, self._cleanup:
            if kind is None:
                files = self._synced()
                older = self._kept_aside(files) if self._overwrite else {}
                end.enter_context(_first_signal_waits(is_last=self._is_last))
                _publish(self._folders, files, older)

    def _synced(self) -> dict[Path, Path]:
        """Sync the staged files to disk, and return them by their final names."""
        staged_files = {
            folder / file.name: file
            for folder, temporary in self._folders.items()
            for file in sorted(temporary.iterdir())
            if not file.is_dir()
        }
        for path, file in staged_files.items():
            with output_errors(path), file.open("rb+") as written:
                os.fsync(written.fileno())
        return staged_files

    def _kept_aside(self, files: Mapping[Path, Path]) -> dict[Path, Path]:
        """Give files that will be replaced or removed a second name, and return it by the first.

        The new `files` get their permissions.
        """
        asides: dict[Path, Path] = {}
        replaced = [path for path in files if os.path.lexists(path)]
        for path in (*replaced, *self._left_over(files)):
            with output_errors(path):
                self._check_replaceable(path)
                if path in files and not path.is_symlink():
                    shutil.copymode(path, files[path])
                asides[path] = self._folders[path.parent] / _ASIDE / path.name
                asides[path].parent.mkdir(exist_ok=True)
                try:
                    os.link(path, asides[path], follow_symlinks=False)
                except OSError:  # a file system without hard links
                    shutil.copy2(path, asides[path], follow_symlinks=False)
        return asides

    def _left_over(self, files: Container[Path]) -> list[Path]:
        """Return the files of earlier runs that this run did not write again."""
        return [
            file
            for folder, is_earlier in self._is_earlier.items()
            for file in folder.glob("*")  # it may not exist
            if file not in files and file.is_file() and not file.is_symlink()
            if _id(file) not in self._inputs and is_earlier(file)
        ]


@contextlib.contextmanager
def _first_signal_waits(*, is_last: bool) -> Iterator[None]:
    """Delay the first signal to the end of the block, or ignore it also after that if `is_last`.

    A second one acts at once. Only Python's handlers are delayed; they run in the main thread.
    """
    waiting: list[int] = []
    handlers = contextlib.ExitStack()

    def wait(number: int, _: object) -> None:
        waiting.append(number)
        handlers.close()

    with handlers:
        for number in ENDING_SIGNALS:
            handler = signal.getsignal(number)
            if callable(handler) and threading.current_thread() is threading.main_thread():
                handlers.callback(signal.signal, number, handler)
                signal.signal(number, wait)
        yield
        if is_last:
            handlers = handlers.pop_all()  # for `wait`
            return
    for came in waiting:
        signal.raise_signal(came)


def _publish(
    folders: Iterable[Path], files: Mapping[Path, Path], older: Mapping[Path, Path]
) -> None:
    """Create folders, give new files their names, remove older ones; undo all if a step fails.

    `files` are new files, and `older` second names of older ones, by their final names. An
    interrupt may come at any time, so what undoes a step is prepared before it, and does nothing if
    it was not done.
    """
    with contextlib.ExitStack() as undo:
        for folder in folders:
            for item in (*reversed(folder.parents), folder):
                if not item.exists():
                    undo.callback(_remove_empty, item)
            with output_errors(folder):
                folder.mkdir(parents=True, exist_ok=True)
        for path, file in files.items():
            with output_errors(path):
                if path in older:
                    undo.callback(older[path].replace, path)
                    file.replace(path)
                else:
                    undo.callback(_remove_name, path, file)
                    _add_name(path, file)
        for path in older.keys() - files.keys():
            with output_errors(path):
                undo.callback(older[path].replace, path)
                path.unlink()
        undo.pop_all()


def _remove_empty(folder: Path) -> None:
    with contextlib.suppress(OSError):  # another run may have written into it
        folder.rmdir()


def _remove_name(path: Path, file: Path) -> None:
    """Undo `_add_name`, if it was done."""
    if not file.exists() or (path.exists() and path.samefile(file)):
        path.unlink(missing_ok=True)


def _add_name(path: Path, file: Path) -> None:
    """Give a file its final name, atomically where the file system has hard links.

    Raises `OutputError` if another file has this name.
    """
    try:
        os.link(file, path)
    except OSError:
        if os.path.lexists(path):
            raise OutputError(f"{path}: appeared during the run; use another output") from None
        file.replace(path)  # a file system without hard links


def _existing(path: Path) -> Path:
    """Return the nearest folder of a path that exists; itself if it does."""
    return next(item for item in (path, *path.parents) if item.exists())


def _make_temporary(path: Path, cleanup: contextlib.ExitStack) -> Path:
    """Create an empty, locked folder near `path`; `cleanup` unlocks and removes it."""
    while True:
        parent = _existing(path)  # a failed run may remove it
        remove_stale(parent)
        folder = parent / f".vdet-{_HOST}-{os.urandom(8).hex()}"
        # An interrupt may come as soon as the folder exists.
        cleanup.callback(shutil.rmtree, folder, ignore_errors=True)
        with contextlib.suppress(FileNotFoundError, BlockingIOError):  # removed as stale
            folder.mkdir(0o700)  # private content stays private while it is written
            cleanup.enter_context(_locked_folder(folder))
            folder.lstat()
            return folder


def lock(descriptor: int) -> bool:
    """Lock a file for this process until it is closed.

    Returns False where files have no locks: on some network disks.

    Raises
    ------
    BlockingIOError
        Another process has locked it.
    """
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError:
        return False
    return True


@contextlib.contextmanager
def _locked_folder(folder: Path) -> Iterator[bool]:
    """Lock a folder for a `with` block; yield whether it is locked. Errors are those of `lock`."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_NOFOLLOW | os.O_DIRECTORY)
    try:
        yield lock(descriptor)
    finally:
        os.close(descriptor)


def remove_stale(folder: Path) -> None:
    """Remove the temporary folders in `folder` whose writers have ended."""
    with contextlib.suppress(OSError):
        for name in filter(_TEMPORARY.fullmatch, os.listdir(folder)):  # noqa: PTH208  # thousands
            with contextlib.suppress(OSError), _locked_folder(folder / name) as is_locked:
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


def is_hidden(name: PurePath) -> bool:
    """Return whether a name is that of a hidden file, or one that macOS adds to zip files."""
    return any(part.startswith((".", "__MACOSX")) for part in name.parts)


def valid_text(text: str) -> str:
    """Return text that UTF-8 can hold; what is invalid, as in some file names, is escaped."""
    return text.encode("utf-8", "backslashreplace").decode()


def write_text(path: Path, text: str) -> None:
    """Write `valid_text` as UTF-8."""
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
    return json_line(values, indent=2, ensure_ascii=ensure_ascii)


def json_line(values: Any, **options: Any) -> str:
    """Return values as a line of JSON, with `options` of `json.dumps`; NaN and infinity are null.

    JSON has no such numbers.
    """
    try:
        return json.dumps(values, allow_nan=False, **options) + "\n"
    except ValueError:
        from pydantic_core import to_jsonable_python  # only plug-ins have such numbers

        finite = to_jsonable_python(values, inf_nan_mode="null")
        return json.dumps(finite, **options) + "\n"


def read_whole(path: Path, *, limit: int, what: str, error: type[VdetError]) -> bytes:
    """Return the content of a file.

    Parameters
    ----------
    limit
        Bytes. A larger file is rejected after `limit` + 1 bytes, whatever size it claims.
    what
        What the file should be, for messages.
    error
        Type of the error to raise if the file cannot be read, or is larger.
    """
    try:
        with path.open("rb") as file:
            data = file.read(limit + 1)
    except OSError as fault:
        raise error(f"{path}: cannot be read: {fault.strerror}") from fault
    if len(data) > limit:
        raise error(f"{path}: is larger than {limit:,} bytes, too large for a {what}")
    return data

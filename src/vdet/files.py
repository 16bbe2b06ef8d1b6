"""Files: outputs that appear under their names only when complete, inputs read up to a limit.

A temporary file lies beside its output. Its name has one form, `.name.vdet-1a2b3c4d.suffix`, and
its writer holds a lock on it. The system releases the lock when the process ends, however it ends.
So what a killed run left can be told from what another run is writing at this moment, also on other
machines of a shared file system.
"""

import contextlib
import json
import os
import re
import secrets
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO, Any, Self

from vdet.errors import OutputError, VdetError

try:
    import fcntl
except ImportError:  # Windows: no lock is taken, and nothing is held for forsaken
    fcntl = None  # type: ignore[assignment]

_NAME = re.compile(r"\..*\.vdet-[0-9a-f]{8}(\.[^.]*)?", re.DOTALL)
_LONGEST_STEM = 200  # bytes; a whole name may have 255
_FLAGS = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
_LONGEST_NAME = 80  # of a name in a message, characters
_CHUNK = 1_000_000  # bytes


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


class OutputFiles:
    """The output files of one run, which appear under their names together; a context manager.

    `stage` gives temporary files. When the block ends well, they are brought to the disk and then
    renamed, in the order in which they were staged; when it ends with an error they are removed.
    If one cannot be renamed, those that have appeared and that replaced nothing are removed again.

    Raises
    ------
    OutputError
        A file cannot be made, brought to the disk or renamed, or an `OSError` that is not a
        `VdetError` already came out of the block.
    """

    def __init__(self) -> None:
        self._staged: list[tuple[Path, Path]] = []
        self._stack = contextlib.ExitStack()

    def __enter__(self) -> Self:
        return self

    def stage(self, path: Path) -> Path:
        """Return a new, empty temporary file beside `path`, of the same suffix."""
        remove_stale(path.parent)
        with _named(path):
            temporary = self._stack.enter_context(temporary_beside(path))
        self._staged.append((temporary, path))
        return temporary

    def __exit__(self, kind: type[BaseException] | None, error: Any, _: object) -> None:
        with self._stack:
            if kind is None:
                self._publish()
        if isinstance(error, OSError) and not isinstance(error, VdetError) and self._staged:
            path = self._staged[0][1]
            raise _unwritable(path, error) from error

    def _publish(self) -> None:
        appeared: list[Path] = []
        try:
            for temporary, path in self._staged:
                with _named(path):
                    bring_to_disk(temporary)
            for temporary, path in self._staged:
                is_new = not path.exists()
                with _named(path):
                    temporary.replace(path)
                if is_new:
                    appeared.append(path)
        except BaseException:
            for path in appeared:
                path.unlink(missing_ok=True)
            raise


@contextlib.contextmanager
def _named(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise _unwritable(path, error) from error


def _unwritable(path: Path, error: OSError) -> OutputError:
    return OutputError(f"{path}: cannot be written: {error.strerror or error}")


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary file beside `path`, renamed to `path` at the end: `OutputFiles` for one."""
    with OutputFiles() as files:
        yield files.stage(path)


def write_json(values: Any, target: str) -> None:
    """Write to the file `target`, or to standard output for `-`. Raises `OutputError`."""
    text = json.dumps(values, indent=2, allow_nan=False) + "\n"
    if target == "-":
        sys.stdout.write(text)
        return
    with replacing(Path(target)) as temporary:
        temporary.write_text(text, encoding="utf-8")


@contextlib.contextmanager
def temporary_beside(path: Path) -> Iterator[Path]:
    """Give a new, empty file in the folder of `path`, of its suffix; what is left of it goes.

    Raises
    ------
    OSError
        The file cannot be made.
    """
    temporary, descriptor = _make(path)
    try:
        yield temporary
    finally:
        temporary.unlink(missing_ok=True)
        if descriptor is not None:
            os.close(descriptor)


def bring_to_disk(path: Path) -> None:
    """Wait until what was written to a file, by whatever means, has arrived. Raises `OSError`."""
    descriptor = os.open(path, _FLAGS)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def remove_stale(folder: Path) -> None:
    """Remove the temporary files in `folder` whose writers have ended."""
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if _NAME.fullmatch(entry.name):
                with contextlib.suppress(OSError):
                    _remove_if_stale(entry.path)


def _make(path: Path) -> tuple[Path, int | None]:
    """Return a new file, and the descriptor that holds its lock, where there are locks."""
    stem = os.fsencode(path.stem)[:_LONGEST_STEM].decode(errors="ignore")
    while True:
        candidate = path.with_name(f".{stem}.vdet-{secrets.token_hex(4)}{path.suffix}")
        descriptor = os.open(candidate, _FLAGS | os.O_CREAT | os.O_EXCL, 0o666)
        if fcntl is None:
            os.close(descriptor)
            return candidate, None
        # Somebody who was removing forsaken files may have come between the two calls.
        if _lock(descriptor) and os.fstat(descriptor).st_nlink:
            return candidate, descriptor
        os.close(descriptor)


def _remove_if_stale(path: str) -> None:
    if fcntl is None:
        return
    descriptor = os.open(path, _FLAGS)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.unlink(path)  # noqa: PTH108
    finally:
        os.close(descriptor)


def _lock(descriptor: int) -> bool:
    """Return False if another has the lock. Where files have no locks, none is forsaken either."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True


def read_whole(path: Path, *, most: int, what: str, error: type[VdetError]) -> bytes:
    """Return the content of a file.

    Parameters
    ----------
    most
        Bytes; a larger file is refused after so many, whatever size it claims to have.
    what
        What the file should be, for the message.
    error
        Raised where the file cannot be read, or is larger.
    """
    try:
        with path.open("rb") as file:
            data = b"".join(_chunks(file, most + 1))
    except OSError as fault:
        raise error(f"{path}: cannot be read: {fault.strerror}") from fault
    if len(data) > most:
        raise error(f"{path}: is larger than {most:,} bytes; that is no {what}")
    return data


def _chunks(file: IO[bytes], most: int) -> Iterator[bytes]:
    """Give at most so many bytes; asked for all at once, memory is set aside for `most`."""
    while chunk := file.read(min(most, _CHUNK)):
        yield chunk
        most -= len(chunk)


def escaped(name: str) -> str:
    """Return a name from outside on one line, without what a terminal would obey."""
    return name if name.isprintable() else ascii(name)


def printable(name: str) -> str:
    """Return a name from outside as messages show it: escaped, and cut where it is very long."""
    shown = escaped(name)
    return shown if len(shown) <= _LONGEST_NAME else f"{shown[:_LONGEST_NAME]}…"

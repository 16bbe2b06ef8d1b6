"""Outputs that are published while something happens after one of the system calls.

As a program, it is killed after each of them: `python -m publishing FOLDER [--no-links]`.
"""

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any

from vdet.files import OutputFiles

BEFORE = dict.fromkeys(["1.txt", "2.txt", "in/of-an-earlier-run.txt"], "old")
AFTER = dict.fromkeys(["1.txt", "2.txt", "in/3.txt", "new/in/4.txt"], "new")


def make_older(folder: Path) -> Path:
    """Make a folder with older files, one of which is a link to another file."""
    (folder / "in").mkdir(parents=True)
    for name, text in BEFORE.items():
        (folder / name).write_text(text)
    (folder / "2.txt").unlink()
    (folder / "2.txt").symlink_to("1.txt")
    return folder


def texts(folder: Path) -> dict[str, str]:
    """Return the texts of all files and folders, also of temporary ones."""
    return {
        str(path.relative_to(folder)): path.read_text() if path.is_file() else "folder"
        for path in folder.rglob("*")
    }


def publish(folder: Path, *, is_last: bool = False, before: Callable[[], object] = list) -> None:
    """Publish new files, and call `before` when they are written."""
    with OutputFiles(overwrite=True, is_last=is_last) as files:
        for name, text in AFTER.items():
            path = folder / name
            (files.stage_folder(path.parent, _is_text) / path.name).write_text(text)
        before()


def _is_text(path: Path) -> bool:
    return path.suffix == ".txt"


def without_links(*_: object, **__: object) -> None:
    """Fail like `os.link` on a file system without hard links."""
    raise PermissionError(1, "Operation not permitted")


@contextmanager
def at_system_call(
    number: int, act: Callable[[], object], *, event: str = "c_return"
) -> Iterator[Callable[[], None]]:
    """Yield a function that begins to count system calls; `act` is called after this one, from 0.

    With the event "c_call" it is called before, and may raise an error instead.
    """
    passed = iter([False] * number + [True])

    def profile(_: object, kind: str, function: Any) -> None:
        is_call = kind == event and function.__module__ in ("posix", "_io", "fcntl")
        if is_call and next(passed, False):
            sys.setprofile(None)
            act()

    try:
        yield lambda: sys.setprofile(profile)
    finally:
        sys.setprofile(None)


def main() -> None:
    """Publish in numbered folders; each process is killed one system call later."""
    os.fsync = lambda fd: None  # noqa: ARG005  # as in the tests of this process
    if "--no-links" in sys.argv:
        os.link = without_links
    for number in count():
        folder = make_older(Path(sys.argv[1], str(number)))
        if not (child := os.fork()):
            with at_system_call(number, lambda: os.kill(os.getpid(), signal.SIGKILL)) as begin:
                publish(folder, before=begin)
            os._exit(0)
        if not os.waitpid(child, 0)[1]:
            return


if __name__ == "__main__":
    main()

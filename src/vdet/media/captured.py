"""What C libraries write on standard error, caught: there they comment on damaged files."""

import contextlib
import os
import tempfile
import threading
from collections.abc import Iterator

_MOST = 10_000  # bytes of comments that are kept
_STDERR = 2
_alone = threading.Lock()  # the file descriptor is the whole process's


@contextlib.contextmanager
def capture_stderr() -> Iterator[list[str]]:
    """Keep standard error silent in the block; the list then holds the lines written meanwhile."""
    lines: list[str] = []
    with _alone, tempfile.TemporaryFile() as caught, contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):  # a process may have none
            outside = os.dup(_STDERR)
            stack.callback(os.close, outside)
            stack.callback(os.dup2, outside, _STDERR)
            os.dup2(caught.fileno(), _STDERR)
        yield lines
        caught.seek(0)
        lines += caught.read(_MOST).decode("utf-8", "replace").splitlines()

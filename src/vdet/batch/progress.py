"""How far a batch is: frames done and expected of every file, and the time that is left.

Worker processes of this machine write their counts into a file that all of them have mapped.
"""

import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from vdet.boxes import BoolArray, Float64Array
from vdet.progress import Advance, Progress, no_progress

_ROW = np.dtype([("began", "f8"), ("done", "i8"), ("expected", "i8"), ("ended", "?")])
"""Of a file: when it was begun, seconds since 1970; frames done and expected, 0 for unknown."""

Rows = npt.NDArray[np.void]


@dataclass(frozen=True, slots=True)
class FrameCounts:
    """The counts of `files` files in the file at `path`. It can be sent to worker processes."""

    path: Path
    files: int

    def rows(self) -> Rows:
        """Return the counts of all files, `(files,)`; changes are seen by all processes."""
        return np.memmap(self.path, _ROW, "r+", shape=(self.files,))

    def progress_of(self, number: int) -> Progress:
        """Return a `Progress` that counts the frames of a file.

        It counts nothing in a process that cannot see `path`, as on another machine.
        """
        try:
            rows = self.rows()
        except OSError:
            return no_progress

        def start(expected: int | None) -> Advance:
            rows[number] = (time.time(), 0, expected or 0, False)

            def advance(frames: int) -> None:
                rows["done"][number] += frames

            return advance

        return start

    def end(self, number: int, frames: int | None) -> None:
        """Note that a file has ended; `frames` is None if it failed."""
        row = self.rows()[number : number + 1]
        row["done"] = row["done"] if frames is None else frames
        row["expected"], row["ended"] = row["done"], True


@contextmanager
def frame_counts(files: int) -> Iterator[FrameCounts]:
    """Give counts for files of which none is begun. Raises `OSError`."""
    with tempfile.NamedTemporaryFile(prefix="vdet-") as file:
        file.truncate(files * _ROW.itemsize)
        yield FrameCounts(Path(file.name), files)


@dataclass(frozen=True, slots=True)
class BatchState:
    """How far a batch is.

    Attributes
    ----------
    done
        Frames done.
    total
        Frames of all files. Of files that are not begun, it is guessed from their size.
    ended
        Number of files that have ended.
    seconds_left
        None before the first frame is done.
    running
        Numbers of the files in work, with the share of each that is done (0 if unknown).
    """

    done: int
    total: int
    ended: int
    seconds_left: float | None
    running: tuple[tuple[int, float], ...]


def batch_state(rows: Rows, sizes: Sequence[float], began: float, now: float) -> BatchState:
    """Return how far a batch is.

    The time left is that of all frames at the rate of the whole batch so far, but at least that of
    the slowest file at its own rate: at the end, fewer files are in work at once.

    Parameters
    ----------
    sizes
        Of the files: anything that is about proportional to their frames.
    began, now
        Seconds since 1970.
    """
    done, ended = rows["done"].astype(float), rows["ended"]
    running = (rows["began"] > 0) & ~ended
    expected = np.maximum(_expected(rows, np.array(sizes, float)), done)
    return BatchState(
        done=int(done.sum()),
        total=round(float(expected.sum())),
        ended=int(np.count_nonzero(ended)),
        seconds_left=_seconds_left(rows, expected - done, running, began, now),
        running=tuple(
            (int(number), float(done[number] / expected[number]) if expected[number] else 0.0)
            for number in np.flatnonzero(running)
        ),
    )


def _expected(rows: Rows, sizes: Float64Array) -> Float64Array:
    """Return the frames of all files, where unknown by the sizes of those that are known."""
    known = (rows["expected"] > 0) | rows["ended"]
    size = sizes[known].sum()
    ratio = rows["expected"][known].sum() / size if size else 0.0
    return np.where(known, rows["expected"], sizes * ratio)


def _seconds_left(
    rows: Rows, left: Float64Array, running: BoolArray, began: float, now: float
) -> float | None:
    done = rows["done"]
    if not done.sum():
        return None
    together = left.sum() * (now - began) / done.sum()
    counted = running & (done > 0)
    if not counted.any():
        return float(together)
    pace = (now - rows["began"][counted]) / done[counted]  # seconds a frame
    alone = np.full(len(left), pace.mean())
    alone[counted] = pace
    return float(max(together, (left * alone).max()))

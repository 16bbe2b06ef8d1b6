"""How far a batch is: frames done and expected of every file.

Worker processes of this machine write their counts into a file that all of them have mapped.
"""

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from vdet.progress import Advance, Progress, no_progress
from vdet.run.video import VideoJob


@dataclass(frozen=True, slots=True)
class FrameCounts:
    """The counts of files in the file at `path`. It can be sent to worker processes.

    `sizes` are about proportional to the frames of the files.
    """

    path: Path
    sizes: tuple[float, ...]

    def _rows(self) -> npt.NDArray[np.int64]:
        """Return frames done, frames expected (0: unknown), and whether it has ended, by file.

        Changes are seen by all processes.
        """
        return np.memmap(self.path, np.int64, "r+", shape=(len(self.sizes), 3))

    def progress_of(self, number: int) -> Progress:
        """Return a `Progress` that counts the frames of a file.

        It counts nothing in a process that cannot see `path`, as on another machine.
        """
        try:
            row = self._rows()[number]
        except OSError:
            return no_progress

        def start(expected: int | None) -> Advance:
            row[:] = 0, expected or 0, False

            def advance(frames: int) -> None:
                row[0] += frames

            return advance

        return start

    def end(self, number: int, frames: int | None) -> None:
        """Note that a file has ended; `frames` is None if it failed."""
        row = self._rows()[number]
        row[:] = *[row[0] if frames is None else frames] * 2, True

    def state(self) -> tuple[int, int, int]:
        """Return the frames done, the frames of all files, and how many files have ended.

        The frames of files that are not begun are guessed from their sizes.
        """
        sizes = np.array(self.sizes)
        done, expected, ended = self._rows().T
        known = (expected > 0) | (ended > 0)
        guessed = sizes * expected[known].sum() / max(sizes[known].sum(), 1e-9)
        total = np.maximum(np.where(known, expected, guessed), done).sum()
        return int(done.sum()), round(float(total)), int(ended.sum())


@contextmanager
def frame_counts(jobs: Sequence[VideoJob]) -> Iterator[FrameCounts | None]:
    """Give counts for jobs of which none is begun; None where there is no room for them."""
    try:
        file = tempfile.NamedTemporaryFile(prefix="vdet-")  # noqa: SIM115
        file.truncate(len(jobs) * 3 * 8)
    except OSError:
        yield None
        return
    with file:
        yield FrameCounts(Path(file.name), tuple(map(_size, jobs)))


def _size(job: VideoJob) -> float:
    """Return the bytes of a video; 1 if only a part of it is read."""
    try:
        return 1.0 if job.is_part else float(job.source.stat().st_size)
    except OSError:
        return 0.0

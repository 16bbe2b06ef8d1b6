"""Many runs of the program on bad files, in one other process.

`try_all` starts this file as a program. In it, every run has a limit of processor time, which a
busy machine does not use up. The process has a limit of memory. The standard error of each run is
kept, also what C libraries write to it.
"""

import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from types import FrameType
from typing import IO

MEMORY = 1_000_000_000
"""Maximum number of bytes that the process may have resident."""
_ADDRESSES = 4_000_000_000  # bytes; protects the machine
_OF_LIBTIFF = ("ZIPDecode: ", "PredictorSetup: ", "tempfile.tif: ")
"""Beginnings of lines that libtiff writes to standard error itself."""
_SECONDS = 20.0  # of processor time, for each run
_PATIENCE = 3000  # seconds for all runs, on a very busy machine; usually some 10 s


@dataclass(frozen=True)
class Trial:
    """The outcome of a run: exit code (None: not ended in time), standard error, processor seconds.

    `memory` is the peak resident memory of the process up to its end, bytes.
    """

    arguments: tuple[str, ...]
    code: int | None
    err: str
    seconds: float
    memory: int


def try_all(runs: Sequence[Sequence[str | Path]]) -> list[Trial]:
    """Run the program with each list of arguments, each for at most 20 s of processor time."""
    orders = json.dumps([[str(word) for word in words] for words in runs])
    command = [sys.executable, __file__]
    done = subprocess.run(
        command, input=orders, capture_output=True, text=True, timeout=_PATIENCE, check=False
    )
    assert done.returncode == 0, f"the process died ({done.returncode}): {done.stderr[-2000:]}"
    records = [json.loads(line) for line in done.stdout.splitlines()]
    return [Trial(**{**record, "arguments": tuple(record["arguments"])}) for record in records]


def try_files(
    folder: Path,
    contents: Mapping[str, bytes],
    arguments: Callable[[Path, Path], Sequence[str | Path]],
    *,
    lines: int = 1,
) -> list[Trial]:
    """Run the program on files of these contents; return the runs, after checks that hold for all.

    `arguments` returns those for a file and the folder of outputs. No promise is broken, no input
    is changed, and nothing is written elsewhere.
    """
    inside, out = folder / "in", folder / "out"
    inside.mkdir(parents=True)
    out.mkdir()
    for name, data in contents.items():
        (inside / name).write_bytes(data)
    others = {path.parent for path in folder.rglob("*")}
    runs = [arguments(inside / name, out) for name in contents]
    trials = try_all(runs)
    assert broken_promises(trials, lines=lines) == []
    assert files_in(inside) == {inside / name: data for name, data in contents.items()}
    assert {path.parent for path in folder.rglob("*")} <= others | {out}
    return trials


def broken_promises(trials: Sequence[Trial], *, lines: int = 1) -> list[str]:
    """Return what is wrong with each run; a failure may write up to `lines` lines of error."""
    return [
        f"{' '.join(trial.arguments)}: {complaint}"
        for trial in trials
        if (complaint := _complaint(trial, lines))
    ]


def _complaint(trial: Trial, lines: int) -> str | None:
    harmless = ("vdet: warning: ", "vdet: note: ", *_OF_LIBTIFF)
    said = [line for line in trial.err.splitlines() if not line.startswith(harmless)]
    if trial.code is None:
        return f"did not end in {trial.seconds:.0f} s of processor time"
    if trial.code not in {0, 1}:
        return f"exit code {trial.code}: {trial.err}"
    if trial.code == 0:
        said = [line for line in said if not line.endswith(": written")]
    if "internal error" in trial.err or not all(line.startswith("vdet: ") for line in said):
        return f"not an error for people: {trial.err}"
    if trial.code and not 1 <= len(said) <= lines:
        return f"{len(said)} lines of error: {trial.err}"
    if trial.memory > MEMORY:
        return f"took {trial.memory / 1e6:.0f} MB"
    return None


def files_in(folder: Path) -> dict[Path, bytes]:
    """Return all files below a folder with their content."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


class _TookTooLong(BaseException):
    pass


def _give_up(_: int, __: FrameType | None) -> None:
    raise _TookTooLong


def _main() -> None:
    from vdet.cli import main

    resource.setrlimit(resource.RLIMIT_AS, (_ADDRESSES, _ADDRESSES))
    signal.signal(signal.SIGPROF, _give_up)
    report = os.fdopen(os.dup(1), "w", encoding="utf-8")
    with tempfile.TemporaryFile() as said, Path(os.devnull).open("w", encoding="utf-8") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(said.fileno(), 2)
        for arguments in json.load(sys.stdin):
            trial = _try(main, arguments, said)
            print(json.dumps(asdict(trial)), file=report, flush=True)


def _try(main: Callable[[Sequence[str]], int], arguments: list[str], said: IO[bytes]) -> Trial:
    began = time.process_time()
    code: int | None = None
    signal.setitimer(signal.ITIMER_PROF, _SECONDS)
    try:
        code = main(arguments)
    except _TookTooLong:
        pass
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    sys.stderr.flush()
    said.seek(0)
    words = said.read().decode("utf-8", "replace")
    said.seek(0)
    said.truncate()
    peak = Path("/proc/self/status").read_text(encoding="ascii").partition("VmHWM:")[2].split()[0]
    return Trial(tuple(arguments), code, words, time.process_time() - began, int(peak) * 1024)


if __name__ == "__main__":
    _main()

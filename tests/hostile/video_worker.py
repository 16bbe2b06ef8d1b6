"""Runs `vdet detect-video` on every file of a folder, in one process: one line of JSON per run.

Called as `video_worker.py IN OUT SECONDS OPTION…`. A run that takes longer than SECONDS, or that
crashes, ends the process with a traceback on standard error. The last line names its file: a line
is written before each run too.
"""

import contextlib
import faulthandler
import io
import json
import re
import resource
import sys
from pathlib import Path

from vdet.cli import main


def run_all(sources: Path, outputs: Path, seconds: float, options: list[str]) -> None:
    for source in sorted(sources.iterdir()):
        report(source, None, "")
        faulthandler.dump_traceback_later(seconds, exit=True)
        said = io.StringIO()
        code: object = None
        with contextlib.redirect_stderr(said):
            try:
                main(["detect-video", str(source), str(outputs / f"{source.stem}.mp4"), *options])
            except SystemExit as ended:
                code = ended.code
        faulthandler.cancel_dump_traceback_later()
        report(source, code, said.getvalue())


def report(source: Path, code: object, said: str) -> None:
    """Report a run; `code` is None before it, `peak` is the peak memory so far, bytes."""
    peak = peak_memory()
    print(json.dumps({"source": source.name, "code": code, "said": said, "peak": peak}), flush=True)


def peak_memory() -> int:
    """Return the peak memory of this process, bytes; `getrusage` counts its parent's too."""
    status = Path("/proc/self/status")
    if status.exists() and (peak := re.search(r"VmHWM:\s+(\d+) kB", status.read_text())):
        return int(peak[1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


if __name__ == "__main__":
    run_all(Path(sys.argv[1]), Path(sys.argv[2]), float(sys.argv[3]), sys.argv[4:])

"""Systems that lack what others have: Windows, macOS."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from running import names, with_modules
from vdet.system import blocked_interrupts

LACKING = """
import os, signal, sys

for name in ("fcntl", "resource"):
    sys.modules[name] = None
for module, names in (
    (os, "fork forkpty register_at_fork sched_getaffinity getuid O_NOFOLLOW O_DIRECTORY"),
    (signal, "SIGHUP pthread_kill"),
):
    for name in names.split():
        delattr(module, name)
"""

USES_THE_API = r"""
from pathlib import Path
import numpy as np
import vdet

clip, lines = Path("in.mp4"), Path("lines.yaml")
assert vdet.Detector().detect(np.full((360, 640, 3), 90, np.uint8)) is not None
results = list(vdet.follow(clip, frames=8))
assert len(results) == 8 and results[-1].tracks
for overwrite in (False, True):
    run = vdet.Run(clip, frames=8, overwrite=overwrite)
    vdet.detect_video(run, "out.mp4", tracks=["t.csv", "t.jsonl"])
header = "frame,time,id,x,y,width,height,score,state,class"
rows = [f"{i},{i / 25},1,{10 * i},80,30,20,1,detected,car" for i in range(20)]
Path("moving.csv").write_text("\n".join([header, *rows]))
visits = vdet.count("moving.csv", vdet.load_settings(lines)).totals
counted = {visit.direction: visit.count for visit in visits if visit.count}
assert counted == {"appear": 1, "vanish": 1}, counted
vdet.evaluate_tracks("t.csv", "t.csv")
"""

USES_THE_PROGRAM = """
import sys
from vdet.process import run

sys.argv = ["vdet", "count", "t.jsonl", "-c", "lines.yaml", "--counts", "counts.csv"]
run()
"""

LINES = """
camera: {size: [320, 180]}
traffic: {zones: [{name: road, points: [[0, 0], [320, 0], [320, 180], [0, 180]]}]}
"""


def test_without_locks_limits_and_forks_vehicles_are_found_followed_and_counted(
    clip_path: Path, tmp_path: Path
) -> None:
    (tmp_path / "sitecustomize.py").write_text(LACKING)
    (tmp_path / "in.mp4").symlink_to(clip_path)
    (tmp_path / "lines.yaml").write_text(LINES)
    for code in (USES_THE_API, USES_THE_PROGRAM):
        done = subprocess.run(
            [sys.executable, "-c", code],
            cwd=tmp_path,
            env=with_modules(tmp_path),
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.returncode, done.stderr) == (0, ""), done.stderr
    made = {"out.mp4", "t.csv", "t.jsonl", "moving.csv", "counts.csv"}
    assert set(names(tmp_path)) == made | {"in.mp4", "lines.yaml", "sitecustomize.py"}


def test_ctrl_c_comes_after_the_block_and_never_in_processes_that_start_in_it() -> None:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    shows_blocked = "import signal; print(signal.pthread_sigmask(signal.SIG_BLOCK, []))"
    blocked = ""

    def start() -> None:
        nonlocal blocked
        with blocked_interrupts():
            signal.raise_signal(signal.SIGINT)
            blocked = subprocess.check_output([sys.executable, "-c", shows_blocked], text=True)

    try:
        with pytest.raises(KeyboardInterrupt):
            start()
    finally:
        signal.signal(signal.SIGINT, before)
    assert "SIGINT" in blocked

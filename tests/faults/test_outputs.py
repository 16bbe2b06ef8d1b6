"""Outputs that cannot be written, and an error inside the program."""

import ctypes
import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

from conftest import Run
from faults.conftest import Start
from red_cars import red_settings
from running import names, write_drive
from vdet.batch import process_file
from vdet.run import video
from vdet.run.sinks import Output
from vdet.track.motion.tracker import MotionTracker
from vdet.track.rules import RulesTracker

LIMIT = 5_000  # bytes: the short clip is smaller, the others are not
CAP_DAC_OVERRIDE = 1
PR_CAPBSET_DROP = 24


def test_a_full_disk_fails_what_does_not_fit(launch: Start, clips: Path, tmp_path: Path) -> None:
    running = launch("detect-video", clips, "-d", tmp_path, "--jobs", "2", largest_file=LIMIT)
    result = running.finish()
    assert result.code == 3, result.err
    assert names(tmp_path) == ["manifest.jsonl", "short.mp4"]
    records = [json.loads(line) for line in (tmp_path / "manifest.jsonl").read_text().splitlines()]
    errors = {Path(r["input"]).stem: r["error"] for r in records}
    assert errors["short"] is None
    for name in ("a", "b"):
        assert errors[name] == f"{tmp_path / name}.mp4: cannot be written: File too large"
        assert f"vdet: {errors[name]}\n" in result.err


def _give_up_root_access_to_files() -> None:
    if os.geteuid() == 0:
        ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, 0, 0, 0)


def test_a_folder_that_cannot_be_written_is_refused_before_any_work(
    launch: Start, clips: Path, tmp_path: Path
) -> None:
    tmp_path.chmod(0o555)
    arguments = ("detect-video", clips, "-d", tmp_path / "out")
    result = launch(*arguments, before=_give_up_root_access_to_files).finish()
    assert result.code == 1
    assert f"the folder {tmp_path} cannot be written to" in result.err
    assert result.err.count("\n") == 1
    tmp_path.chmod(0o755)
    assert names(tmp_path) == []


def test_a_tracker_that_raises(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source, out = write_drive(tmp_path / "clip.mp4", 150), tmp_path / "out"
    job = video.Run(source, (Output("video", out / "clip.mp4"), Output("tracks", out / "clip.csv")))

    def update(*_: object) -> None:
        raise ZeroDivisionError("no\nscale")

    monkeypatch.setattr(RulesTracker, "update", update)
    monkeypatch.setattr(MotionTracker, "observe", update)
    out.mkdir()
    record = process_file(replace(job, settings=red_settings(tmp_path)), folder=out)
    assert record.error is not None
    assert "internal error, please report it (ZeroDivisionError: no scale)" in record.error
    result = run("detect-video", source, out / "single.mp4")
    assert (result.code, result.err.count("\n")) == (1, 1)
    assert "internal error, please report it (ZeroDivisionError: no scale)" in result.err
    assert names(out) == []

"""SIGKILL for the program, or for one of its worker processes, in the middle of a video."""

import json
import os
import signal
from pathlib import Path

from faults.conftest import Start
from running import Gate, frames_of, names, until

KILL = signal.SIGKILL


def records_of(folder: Path) -> dict[str, dict[str, object]]:
    lines = [json.loads(line) for line in (folder / "manifest.jsonl").read_text().splitlines()]
    return {Path(record["input"]).name: record for record in lines}


def test_after_a_kill_the_next_run_needs_no_cleaning_up(
    launch: Start, gate: Gate, long_clip: Path, tmp_path: Path
) -> None:
    arguments = ("detect-video", long_clip, tmp_path / "out.mp4", "--tracks", tmp_path / "out.csv")
    running = launch(*arguments, modules=gate.folder)
    until(lambda: bool(gate.held()))
    running.send(KILL)
    assert running.finish().code == -KILL
    assert len(names(tmp_path)) == 2, "an output has its final name, or none was begun"
    assert launch(*arguments, "--frames", "20").finish().code == 0
    assert names(tmp_path) == ["out.csv", "out.mp4"]
    assert frames_of(tmp_path / "out.mp4") == 20


def test_when_a_batch_is_killed_its_workers_end_and_the_next_run_cleans_up(
    launch: Start, gate: Gate, clips: Path, tmp_path: Path
) -> None:
    arguments = ("detect-video", clips, "-d", tmp_path / "out", "--jobs", "2", "--skip-existing")
    running = launch(*arguments, modules=gate.folder)
    until(lambda: len(gate.held()) == 2)
    running.send(KILL)
    until(running.is_alone)
    left = [name for name in names(tmp_path) if ".vdet-" not in name]
    assert left == ["out/manifest.jsonl"]
    result = launch(*arguments, "--frames", "9").finish()
    assert result.code == 0, result.err
    assert names(tmp_path / "out") == ["a.mp4", "b.mp4", "manifest.jsonl", "short.mp4"]
    assert frames_of(tmp_path / "out" / "a.mp4") == 9


def test_when_a_worker_is_killed_its_file_is_done_again(
    launch: Start, gate: Gate, clips: Path, tmp_path: Path
) -> None:
    arguments = ("detect-video", clips, "-d", tmp_path, "--jobs", "2")
    running = launch(*arguments, modules=gate.folder)
    until(lambda: len(gate.held()) == 2)
    os.kill(gate.held()[0], KILL)
    gate.open()
    result = running.finish()
    assert result.code == 0, result.err
    assert names(tmp_path) == ["a.mp4", "b.mp4", "manifest.jsonl", "short.mp4"]
    frames = {name: record["frames"] for name, record in records_of(tmp_path).items()}
    assert frames == {"a.mp4": 100, "b.mp4": 100, "short.mp4": 5}
    until(running.is_alone)
    assert "Traceback" not in result.err


KILLS_ITS_PROCESS = """
import os, signal
from vdet import batch as task

process = task.write_outputs

def killing(job, *arguments, **options):
    if job.source.name == "kills.mp4":
        os.kill(os.getpid(), signal.SIGKILL)
    return process(job, *arguments, **options)

task.write_outputs = killing
"""


def test_a_file_that_always_kills_its_process_is_the_only_one_that_fails(
    launch: Start, clips: Path, tmp_path: Path
) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "sitecustomize.py").write_text(KILLS_ITS_PROCESS)
    for name in ("kills", "intact"):
        os.link(clips / "short.mp4", tmp_path / "in" / f"{name}.mp4")
    running = launch(
        *("detect-video", tmp_path / "in", "-d", tmp_path / "out", "--jobs", "2"), modules=tmp_path
    )
    result = running.finish()
    assert result.code == 3, result.err
    assert names(tmp_path / "out") == ["intact.mp4", "manifest.jsonl"]
    records = records_of(tmp_path / "out")
    assert "kills.mp4: its process was killed" in str(records["kills.mp4"]["error"])
    assert records["intact.mp4"]["error"] is None

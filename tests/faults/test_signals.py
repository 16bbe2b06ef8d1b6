"""After Ctrl-C, SIGTERM or SIGHUP the program removes what is half-written and exits with 130."""

import json
import signal
from pathlib import Path

import pytest

from faults.conftest import Start
from running import Gate, names, until

LOADS_FOR_A_MINUTE = """
import sys, time

class Slow:
    @staticmethod
    def find_spec(name, *_):
        if name == "vdet.cli.command":
            print("loading", file=sys.stderr, flush=True)
            time.sleep(60)

sys.meta_path.insert(0, Slow)
"""

IS_SIGNALLED = """
import os, signal

link = os.link

def signalling(source, target, **options):
    link(source, target, **options)
    if target.suffix == ".mp4":
        os.kill({process}, signal.{name})

os.link = signalling
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_in_the_middle_of_a_video(
    launch: Start, gate: Gate, long_clip: Path, tmp_path: Path, number: signal.Signals
) -> None:
    running = launch(
        *("detect-video", long_clip, tmp_path / "o.mp4", "--tracks", tmp_path / "o.csv"),
        modules=gate.folder,
    )
    until(lambda: bool(gate.held()))
    running.send(number)
    result = running.finish()
    assert (result.code, result.err.strip()) == (130, "vdet: interrupted")
    assert names(tmp_path) == []


@pytest.mark.parametrize(("number", "to_all"), [(signal.SIGINT, True), (signal.SIGTERM, False)])
def test_in_the_middle_of_a_batch(
    launch: Start, gate: Gate, clips: Path, tmp_path: Path, number: signal.Signals, to_all: bool
) -> None:
    folders = ("--page", ".page", "--clips", ".clips", "--crops", ".crops")
    arguments = ("detect-video", clips, "-d", tmp_path, "--jobs", "2", *folders)
    running = launch(*arguments, modules=gate.folder)
    until(lambda: len(gate.held()) == 2)
    running.send(number, to_all=to_all)
    result = running.finish()
    assert (result.code, result.err.strip()) == (130, "vdet: interrupted")
    until(running.is_alone)
    assert [path.name for path in tmp_path.rglob("*")] == ["manifest.jsonl"]


def test_as_outputs_get_their_names(launch: Start, clips: Path, tmp_path: Path) -> None:
    """The work is done: nothing is lost, and nothing temporary is left."""
    code = IS_SIGNALLED.format(process="os.getpid()", name="SIGTERM")
    (tmp_path / "sitecustomize.py").write_text(code)
    out = tmp_path / "out"
    out.mkdir()
    arguments = ("detect-video", clips / "short.mp4", out / "o.mp4", "--tracks", out / "o.csv")
    result = launch(*arguments, modules=tmp_path).finish()
    assert (result.code, result.err.count(": written\n")) == (0, 2), result.err
    assert sorted(path.name for path in out.iterdir()) == ["o.csv", "o.mp4"]


def test_as_outputs_of_a_batch_get_their_names(
    launch: Start, gate: Gate, clips: Path, tmp_path: Path
) -> None:
    """A file that is done stays done; the others are done by the next batch."""
    with (gate.folder / "sitecustomize.py").open("a") as modules:
        modules.write(IS_SIGNALLED.format(process="os.getppid()", name="SIGINT"))
    sources = clips / "a.mp4", clips / "short.mp4"
    arguments = ("detect-video", *sources, "-d", tmp_path, "--skip-existing")
    running = launch(*arguments, "--jobs", "2", modules=gate.folder)
    result = running.finish()
    assert (result.code, result.err.splitlines()[-1]) == (130, "vdet: interrupted"), result.err
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["manifest.jsonl", "short.mp4"]
    (line,) = (tmp_path / "manifest.jsonl").read_text().splitlines()
    assert Path(json.loads(line)["input"]).name == "short.mp4"
    assert ": 1 file done, 1 skipped, 0 failed" in launch(*arguments).finish().err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_while_the_program_is_loaded(launch: Start, tmp_path: Path, number: signal.Signals) -> None:
    (tmp_path / "sitecustomize.py").write_text(LOADS_FOR_A_MINUTE)
    running = launch("--version", modules=tmp_path)
    assert running.process.stderr is not None
    assert running.process.stderr.readline() == "loading\n"
    running.send(number)
    result = running.finish()
    assert (result.code, result.err.strip()) == (130, "vdet: interrupted")


def test_a_signal_that_nohup_ignores_is_ignored(
    launch: Start, gate: Gate, clips: Path, tmp_path: Path
) -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    arguments = ("detect-video", clips / "a.mp4", tmp_path / "out.mp4")
    try:
        running = launch(*arguments, modules=gate.folder)
    finally:
        signal.signal(signal.SIGHUP, before)
    until(lambda: bool(gate.held()))
    running.send(signal.SIGHUP)
    gate.open()
    assert running.finish().code == 0
    assert names(tmp_path) == ["out.mp4"]

"""After Ctrl-C, SIGTERM or SIGHUP the program removes what is half-written and exits with 130."""

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
        if name == "vdet.cli.main":
            print("loading", file=sys.stderr, flush=True)
            time.sleep(60)

sys.meta_path.insert(0, Slow)
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
    arguments = ("detect-video", clips, "-d", tmp_path, "--jobs", "2")
    running = launch(*arguments, modules=gate.folder)
    until(lambda: len(gate.held()) == 2)
    running.send(number, to_all=to_all)
    result = running.finish()
    assert (result.code, result.err.strip()) == (130, "vdet: interrupted")
    until(running.is_alone)
    assert names(tmp_path) == ["manifest.jsonl"]


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

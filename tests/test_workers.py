"""Calls in parallel: each item once, killed processes, and no process that stays."""

import os
import signal
import subprocess
import sys
from contextlib import closing
from functools import partial
from pathlib import Path

import pytest

from running import until
from vdet.workers import LocalProcesses, blocked_interrupts, call_all, core_count


def process_of(_: int) -> int:
    return os.getpid()


def end_after_item_1_began(folder: Path, number: int) -> int:
    """End item 0 when item 1 is in work; the other items do not end."""
    (folder / str(number)).write_text(str(os.getpid()))
    until(lambda: not number and (folder / "1").exists())
    return os.getpid()


def test_items_are_called_once_in_other_processes() -> None:
    results = list(call_all(process_of, range(4), LocalProcesses(1)))
    assert [item for item, _ in results] == [0, 1, 2, 3]
    assert os.getpid() not in {process for _, process in results}
    assert list(call_all(process_of, [], LocalProcesses(1))) == []


def test_an_error_of_the_function_is_raised() -> None:
    with pytest.raises(ZeroDivisionError):
        list(call_all(partial(divmod, 1), [1, 0], LocalProcesses(1)))


def test_when_the_generator_is_closed_the_processes_end(tmp_path: Path) -> None:
    function = partial(end_after_item_1_began, tmp_path)
    with closing(call_all(function, range(10), LocalProcesses(2))) as results:
        assert next(results)[0] == 0
        until(lambda: bool((tmp_path / "1").read_text()))
        process = int((tmp_path / "1").read_text())
        os.kill(process, 0)  # it exists
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
    assert {path.name for path in tmp_path.iterdir()} <= {"0", "1", "2"}


def test_what_ended_processes_left_is_removed_without_a_word(tmp_path: Path) -> None:
    (tmp_path / "left").touch()
    code = f"""if True:
        import vdet.cli
        from joblib.externals.loky.backend import resource_tracker
        from vdet.__main__ import main
        from vdet.workers import LocalProcesses, call_all
        def work_in_processes():
            assert len(list(call_all(abs, [1, 2], LocalProcesses(2)))) == 2
            resource_tracker.register({str(tmp_path / "left")!r}, "file")
            return 0
        vdet.cli.main = work_in_processes
        main()
    """
    result = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    )
    assert result.stderr == ""
    until(lambda: not (tmp_path / "left").exists())


@pytest.mark.parametrize(("text", "cores"), [("max 100000", 8), ("250000 100000", 3), ("", 8)])
def test_a_control_group_limits_the_cores(
    text: str, cores: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)), raising=False)
    monkeypatch.setattr("vdet.workers.QUOTA", tmp_path / "cpu.max")
    assert core_count() == 8
    (tmp_path / "cpu.max").write_text(f"{text}\n")
    assert core_count() == cores


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

"""Calls in parallel: numbered results, one process for each item in work, and killed processes."""

import os
import signal
import subprocess
import sys
import time
from contextlib import closing
from functools import partial
from pathlib import Path

import pytest

from running import until
from vdet.errors import ConfigError
from vdet.workers import (
    LocalProcesses,
    ThisProcess,
    WorkerKilledError,
    Workers,
    core_count,
    make_workers,
)

MAPS = pytest.mark.parametrize("workers", [ThisProcess(), LocalProcesses(1), LocalProcesses(2)])


def negative(item: int) -> int:
    return -item


def process_of(_: int) -> int:
    return os.getpid()


def kill_process_at_2(file: Path, number: int) -> int:
    """Kill this process at item 2, when `file` is there."""
    if number == 2:
        until(file.exists)
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def end_after_item_1_began(folder: Path, number: int) -> None:
    """End item 0 when item 1 is in work; the other items do not end."""
    (folder / str(number)).write_text(str(os.getpid()))
    while number or not (folder / "1").exists():
        time.sleep(0.02)


@MAPS
def test_each_item_is_called_once_and_its_result_numbered(workers: Workers) -> None:
    assert sorted(workers.map(negative, [5, 6, 7, 5])) == [(0, -5), (1, -6), (2, -7), (3, -5)]
    assert list(workers.map(negative, [])) == []


@MAPS
def test_an_error_of_the_function_is_raised(workers: Workers) -> None:
    with pytest.raises(ZeroDivisionError):
        list(workers.map(partial(divmod, 1), [1, 0]))


def test_fewer_than_one_process_are_refused() -> None:
    with pytest.raises(ConfigError, match="jobs: is -1; give 1 or more"):
        make_workers(-1)


@pytest.mark.parametrize(
    ("files", "cores"),
    [
        ({"cpu.max": "max 100000"}, 8),
        ({"cpu.max": "250000 100000"}, 3),
        ({"cpu/cpu.cfs_quota_us": "100000", "cpu/cpu.cfs_period_us": "100000"}, 1),
        ({"cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"}, 8),
        ({}, 8),
    ],
)
def test_a_control_group_limits_the_cores(
    files: dict[str, str], cores: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)), raising=False)
    quotas = (("cpu.max",), ("cpu/cpu.cfs_quota_us", "cpu/cpu.cfs_period_us"))
    monkeypatch.setattr(
        "vdet.workers.QUOTAS", [[tmp_path / name for name in names] for names in quotas]
    )
    (tmp_path / "cpu").mkdir()
    for name, text in files.items():
        (tmp_path / name).write_text(f"{text}\n")
    assert core_count() == cores


def test_one_local_process_is_another_one_and_does_one_item_at_a_time() -> None:
    results = list(LocalProcesses(1).map(process_of, range(4)))
    assert [number for number, _ in results] == [0, 1, 2, 3]
    assert os.getpid() not in {process for _, process in results}


def test_what_ended_processes_left_is_removed_without_a_word(tmp_path: Path) -> None:
    (tmp_path / "left").touch()
    code = f"""if True:
        import sys
        import vdet.cli
        from loky.backend import resource_tracker
        from vdet.process import run
        from vdet.workers import LocalProcesses
        def work_in_processes():
            assert len(list(LocalProcesses(2).map(abs, [1, 2]))) == 2
            resource_tracker.register({str(tmp_path / "left")!r}, "file")
            sys.exit()
        vdet.cli.main = work_in_processes
        run()
    """
    result = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    )
    assert result.stderr == ""
    until(lambda: not (tmp_path / "left").exists())


def test_the_items_that_were_in_work_when_a_process_was_killed_are_lost(tmp_path: Path) -> None:
    file = tmp_path / "item 1 has arrived"
    results = LocalProcesses(1).map(partial(kill_process_at_2, file), range(5))
    assert [next(results), next(results)] == [(0, 0), (1, 1)]
    file.touch()
    with pytest.raises(WorkerKilledError) as caught:
        next(results)
    assert caught.value.lost == {2}


def test_closing_the_generator_ends_the_processes_without_a_warning(tmp_path: Path) -> None:
    with closing(
        LocalProcesses(2).map(partial(end_after_item_1_began, tmp_path), range(10))
    ) as results:
        assert next(results) == (0, None)
        until(lambda: bool((tmp_path / "1").read_text()))
        process = int((tmp_path / "1").read_text())
        os.kill(process, 0)  # it is there
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
    assert {path.name for path in tmp_path.iterdir()} <= {"0", "1", "2"}

"""The process of the program: the current folder, its standard streams, its memory."""

import os
import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import cv2
import pytest

from red_cars import car_at, road
from running import Running, names, start, write_drive

MODULES = ("queue", "typing", "selectors", "socket", "numpy", "joblib", "multiprocessing")
KB = 1024


@pytest.fixture
def batch(tmp_path: Path) -> tuple[str, ...]:
    """Arguments of a batch of three small clips."""
    (tmp_path / "in").mkdir()
    for name in "abc":
        write_drive(tmp_path / "in" / f"{name}.mp4", 2)
    options = ("--no-video", "--tracks", ".csv", "--jobs", "2")
    return ("detect-video", str(tmp_path / "in"), "-d", str(tmp_path / "out"), *options)


@pytest.fixture
def running() -> Iterator[list[Running]]:
    """Programs that are ended after the test."""
    started: list[Running] = []
    yield started
    for item in started:
        item.stop()


def test_nothing_in_the_current_folder_is_imported(
    batch: tuple[str, ...], running: list[Running], tmp_path: Path
) -> None:
    folder = tmp_path / "current"
    folder.mkdir()
    for name in MODULES:
        (folder / f"{name}.py").write_text("open('imported', 'a').write(__name__ + ' ')")
    running.append(start(batch, before=lambda: os.chdir(folder)))
    result = running[0].finish()
    assert not (folder / "imported").exists(), (folder / "imported").read_text()
    assert result.code == 0, result.err
    assert names(tmp_path / "out") == ["a.csv", "b.csv", "c.csv", "manifest.jsonl"]


def test_a_batch_goes_on_without_standard_error(
    batch: tuple[str, ...], running: list[Running], tmp_path: Path
) -> None:
    running.append(start(batch, before=lambda: os.close(2)))
    assert running[0].finish().code == 0
    assert names(tmp_path / "out") == ["a.csv", "b.csv", "c.csv", "manifest.jsonl"]


def test_libraries_use_one_thread_a_call() -> None:
    code = """if True:
        import vdet.cli
        def show():
            import cv2
            print(cv2.getNumThreads())
            return 0
        vdet.cli.main = show
        from vdet.__main__ import main
        main()
    """
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split()[-1] == "1"


def test_a_signal_after_the_work_does_not_change_the_exit_code() -> None:
    code = """if True:
        import os, signal, sys
        from vdet import __main__ as program
        program._exit = lambda _: os.kill(os.getpid(), signal.SIGTERM)
        sys.argv = ["vdet", "--version"]
        program.main()
    """
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_too_little_memory_is_reported_in_one_line(running: list[Running], tmp_path: Path) -> None:
    limit = 300_000 * KB

    def limit_memory() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))

    arguments = ("detect-image", tmp_path / "a.png", "--json", "-")
    running.append(start(arguments, before=limit_memory))
    result = running[0].finish()
    assert result.code == 1
    assert result.err.count("\n") == 1
    assert "emory" in result.err  # the line may be that of OpenBLAS


@pytest.mark.parametrize(
    "command",
    [
        ["config"],
        ["detect-image", "drive.png", "--json", "-"],
        ["detect-video", "drive.mp4", "--no-video", "--tracks", "-"],
    ],
    ids=lambda command: command[0],
)
def test_a_full_standard_output_is_reported_in_one_line(
    command: list[str], running: list[Running], tmp_path: Path
) -> None:
    write_drive(tmp_path / "drive.mp4", 2)
    cv2.imwrite(str(tmp_path / "drive.png"), road(car_at(0)))

    def lose_output() -> None:
        os.chdir(tmp_path)
        os.close(1)
        os.set_inheritable(os.open("/dev/full", os.O_WRONLY), True)

    running.append(start(command, before=lose_output))
    result = running[0].finish()
    assert result.code == 1
    assert "cannot be written" in result.err
    assert result.err.count("\n") == 1

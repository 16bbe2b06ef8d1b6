"""A real Dask scheduler and two worker processes, started here."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from conftest import Run
from running import frames_of, names, start, unfinished, until, write_drive
from vdet.detect.svm.model import load_model
from vdet.errors import ClusterError
from vdet.synthetic import write_patches
from vdet.workers import DaskCluster

pytest.importorskip("distributed")


def dask(kind: str, *options: str, folder: Path) -> "subprocess.Popen[bytes]":
    program = (sys.executable, "-m", f"distributed.cli.dask_{kind}", "--no-dashboard")
    with (folder / f"{kind}.log").open("wb") as log:
        return subprocess.Popen(
            [*program, "--scheduler-file", str(folder / "scheduler.json"), *options],
            stdout=log,
            stderr=log,
            cwd=folder,
            env=os.environ
            | {
                "DASK_TEMPORARY_DIRECTORY": str(folder),
                # Dask itself does not try again: so vdet has to.
                "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0",
            },
        )


@contextmanager
def scheduler(folder: Path) -> "Iterator[tuple[str, subprocess.Popen[bytes]]]":
    """Give the address of a scheduler, and its process."""
    process = dask("scheduler", "--host", "127.0.0.1", "--port", "0", folder=folder)
    try:
        until((folder / "scheduler.json").exists)
        until(lambda: (folder / "scheduler.json").read_text().endswith("}"))
        yield json.loads((folder / "scheduler.json").read_text())["address"], process
    finally:
        process.terminate()
        process.wait()


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The scheduler of two workers."""
    folder = tmp_path_factory.mktemp("cluster")
    with scheduler(folder) as (address, _):
        options = ("--nworkers", "2", "--nthreads", "1")
        workers = dask("worker", *options, folder=folder)
        try:
            log = folder / "worker.log"
            until(lambda: log.read_text().count("Registered to") == 2)
            yield address
        finally:
            workers.terminate()
            workers.wait()


@pytest.fixture
def clips(tmp_path: Path) -> Path:
    (tmp_path / "in").mkdir()
    for name in "abc":
        write_drive(tmp_path / "in" / f"{name}.mp4", 40)
    return tmp_path / "in"


def test_a_batch_is_done_by_the_workers(
    run: Run, address: str, clips: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (clips / "bad.mp4").write_bytes(b"no video")
    monkeypatch.chdir(tmp_path)  # relative names are those of this place, not of the workers'
    result = run("detect-video", "in", "-d", "out", "--tracks", ".txt", "--scheduler", address)
    assert result.code == 3, result.err
    assert "bad.mp4: is not a video" in result.err
    made = [f"{name}.{suffix}" for name in "abc" for suffix in ("mp4", "txt")]
    assert names(tmp_path / "out") == [*made, "manifest.jsonl"]
    lines = (tmp_path / "out" / "manifest.jsonl").read_text().splitlines()
    frames = {Path(record["input"]).stem: record["frames"] for record in map(json.loads, lines)}
    assert frames == {"a": 40, "b": 40, "c": 40, "bad": None}


def test_when_a_worker_is_killed_its_file_is_done_again(address: str, tmp_path: Path) -> None:
    clip = write_drive(tmp_path / "long.mp4", 150)
    out = tmp_path / "out"
    running = start(("detect-video", clip, "-d", out, "--scheduler", address))
    try:
        until(lambda: bool(unfinished(out)))
        os.kill(holder_of(unfinished(out)[0]), signal.SIGKILL)
        result = running.finish()
    finally:
        running.stop()
    assert result.code == 0, result.err
    assert names(out) == ["long.mp4", "manifest.jsonl"]
    assert frames_of(out / "long.mp4") == 150


def holder_of(file: Path) -> int:
    """Give the process that has a file open."""
    for descriptor in Path("/proc").glob("[0-9]*/fd/*"):
        try:
            if descriptor.samefile(file):
                return int(descriptor.parts[2])
        except OSError:
            continue
    pytest.fail("nobody has it open")


def test_training_on_a_cluster_gives_the_same_model(run: Run, address: str, tmp_path: Path) -> None:
    patches = tmp_path / "patches"
    write_patches(patches, seed=5, vehicles=80, non_vehicles=80)
    cheap = ("--set", "detector.features.hog.channels=[0]")
    there, here = tmp_path / "there.npz", tmp_path / "here.npz"
    assert run("train", patches, "-o", there, *cheap, "--scheduler", address).code == 0
    assert run("train", patches, "-o", here, *cheap, "--jobs", "1").code == 0
    first, second = load_model(there), load_model(here)
    assert (first.weights == second.weights).all()
    assert first.provenance["data_sha256"] == second.provenance["data_sha256"]


def test_workers_with_another_version_are_refused(
    run: Run, address: str, clips: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vdet.__version__", "9.9")
    result = run("detect-video", clips, "-d", tmp_path / "out", "--scheduler", address)
    assert result.code == 1
    assert "this worker has vdet 0." in result.err
    assert "here is vdet 9.9; install the same version everywhere" in result.err


def test_a_scheduler_that_has_no_worker_and_one_that_ends(
    tmp_path: Path,
) -> None:
    clip = write_drive(tmp_path / "clip.mp4", 600)
    out = tmp_path / "out"
    with scheduler(tmp_path) as (address, process):
        with pytest.raises(ClusterError, match="the scheduler has no worker"):
            next(DaskCluster(address, worker_timeout=0.1).map(abs, [1]))
        worker = dask("worker", "--no-nanny", folder=tmp_path)
        running = start(("detect-video", clip, "-d", out, "--scheduler", address))
        try:
            until(lambda: bool(unfinished(out)))
            process.kill()
            result = running.finish()
        finally:
            running.stop()
            worker.kill()
            worker.wait()
    assert result.code == 1
    assert result.err == (
        f"vdet: {address}: the scheduler has ended; start it again, and run this again\n"
    )


@pytest.mark.parametrize(
    "address", ["tcp://127.0.0.1:9", "nonsense://x", "tcp://no.such.host.invalid:1"]
)
def test_no_scheduler_there(address: str) -> None:
    with pytest.raises(ClusterError, match="no Dask scheduler answers there"):
        next(DaskCluster(address, connect_timeout=0.5).map(abs, [1]))


def test_without_dask_the_error_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ClusterError, match=r'pip install "vdet\[dask\]"'):
        next(DaskCluster("tcp://x:1").map(abs, [1]))

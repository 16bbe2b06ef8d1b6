"""Work on a real Dask scheduler and two worker processes, started here."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from conftest import Run
from running import Gate, frames_of, names, start, until, with_modules, write_drive
from vdet.errors import BatchError, PackageError
from vdet.workers import DaskCluster, call_all

distributed = pytest.importorskip("distributed")


@dataclass(frozen=True)
class Cluster:
    """A scheduler at `address`; videos of its workers are held at the `gate`."""

    address: str
    gate: Gate


def dask(kind: str, *options: str, folder: Path) -> "subprocess.Popen[bytes]":
    """Start a scheduler or workers. Dask does not repeat an item whose worker was killed."""
    program = (sys.executable, "-m", f"distributed.cli.dask_{kind}", "--no-dashboard")
    with (folder / f"{kind}.log").open("wb") as log:
        return subprocess.Popen(
            [*program, "--scheduler-file", str(folder / "scheduler.json"), *options],
            stdout=log,
            stderr=log,
            cwd=folder,
            env=with_modules(folder)
            | {
                "DASK_TEMPORARY_DIRECTORY": str(folder),
                "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0",
            },
        )


@contextmanager
def scheduler(folder: Path) -> "Iterator[tuple[Cluster, subprocess.Popen[bytes]]]":
    """Start a scheduler; give its cluster, and its process."""
    gate = Gate(folder)
    process = dask("scheduler", "--host", "127.0.0.1", "--port", "0", folder=folder)
    try:
        until((folder / "scheduler.json").exists)
        until(lambda: (folder / "scheduler.json").read_text().endswith("}"))
        address = json.loads((folder / "scheduler.json").read_text())["address"]
        yield Cluster(address, gate), process
    finally:
        process.terminate()
        process.wait()


def registered(folder: Path) -> int:
    """Return how many workers the scheduler of a folder has had."""
    return (folder / "worker.log").read_text().count("Registered to")


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """A scheduler with two workers."""
    folder = tmp_path_factory.mktemp("cluster")
    with scheduler(folder) as (cluster, _):
        workers = dask("worker", "--nworkers", "2", "--nthreads", "1", folder=folder)
        try:
            until(lambda: registered(folder) == 2)
            yield cluster
        finally:
            workers.terminate()
            workers.wait()


@pytest.fixture(scope="module")
def address(cluster: Cluster) -> str:
    return cluster.address


def test_only_an_item_that_always_kills_its_worker_has_no_result(address: str) -> None:
    items = ["10", "__import__('os')._exit(1)", *(str(number) for number in range(12, 20))]
    results = dict(call_all(eval, items, DaskCluster(address)))
    assert results == {item: None if "exit" in item else int(item) for item in items}


def test_when_the_generator_is_closed_the_scheduler_forgets_the_items(
    address: str, tmp_path: Path
) -> None:
    path = f"{str(tmp_path / 'go')!r}"
    wait = f"[None for _ in iter(lambda: __import__('os').path.exists({path}), True)]"
    with distributed.Client(address, set_as_default=False) as observer:
        with closing(call_all(eval, ["0", *[wait] * 20], DaskCluster(address))) as results:
            assert next(results) == ("0", 0)
            until(lambda: any(observer.processing().values()))
        until(lambda: not any(observer.processing().values()))
        (tmp_path / "go").touch()


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
    assert "bad.mp4: cannot be opened, is not a video" in result.err
    made = [f"{name}.{suffix}" for name in "abc" for suffix in ("mp4", "txt")]
    assert names(tmp_path / "out") == [*made, "manifest.jsonl"]
    lines = (tmp_path / "out" / "manifest.jsonl").read_text().splitlines()
    frames = {Path(record["input"]).stem: record["frames"] for record in map(json.loads, lines)}
    assert frames == {"a": 40, "b": 40, "c": 40, "bad": None}


def test_when_a_worker_is_killed_its_file_is_done_again(cluster: Cluster, tmp_path: Path) -> None:
    clip = write_drive(tmp_path / "long.mp4", 150)
    out = tmp_path / "out"
    running = start(("detect-video", clip, "-d", out, "--scheduler", cluster.address))
    try:
        until(lambda: bool(cluster.gate.held()))
        os.kill(cluster.gate.held()[0], signal.SIGKILL)
        cluster.gate.open()
        result = running.finish()
    finally:
        running.stop()
    assert result.code == 0, result.err
    assert names(out) == ["long.mp4", "manifest.jsonl"]
    assert frames_of(out / "long.mp4") == 150


def test_a_scheduler_that_has_no_worker_and_one_that_ends(tmp_path: Path) -> None:
    clip = write_drive(tmp_path / "clip.mp4", 150)
    out = tmp_path / "out"
    with scheduler(tmp_path) as (cluster, process):
        with pytest.raises(BatchError, match="no Dask scheduler with a worker responds"):
            next(call_all(abs, [1], DaskCluster(cluster.address, timeout=0.5)))
        worker = dask("worker", "--no-nanny", folder=tmp_path)
        try:
            until(lambda: registered(tmp_path) == 1)
            running = start(("detect-video", clip, "-d", out, "--scheduler", cluster.address))
            try:
                until(lambda: bool(cluster.gate.held()))
                process.kill()
                result = running.finish()
            finally:
                running.stop()
        finally:
            worker.kill()
            worker.wait()
    assert result.code == 1
    assert result.err == (f"vdet: {cluster.address}: the scheduler has ended; run again\n")


@pytest.mark.parametrize(
    "address", ["tcp://127.0.0.1:9", "nonsense://x", "tcp://no.such.host.invalid:1"]
)
def test_no_scheduler_there(address: str) -> None:
    with pytest.raises(BatchError, match="no Dask scheduler with a worker responds"):
        next(call_all(abs, [1], DaskCluster(address, timeout=0.5)))


def test_without_dask_the_error_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(PackageError, match='extra "dask"'):
        next(call_all(abs, [1], DaskCluster("tcp://x:1")))

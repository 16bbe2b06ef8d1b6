"""One file of a batch."""

import logging
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from red_cars import HEIGHT, SETTINGS, WIDTH, red_finder
from running import names, write_drive
from vdet.batch.task import Work, process_file, record_of_killed, result_digest
from vdet.detect.factory import load_detector
from vdet.detect.protocol import DetectorModel
from vdet.detect.svm.model import save_model
from vdet.run.sinks.protocol import Output
from vdet.run.video import Run, run_video


@pytest.fixture
def job(tmp_path: Path) -> Run:
    source = write_drive(tmp_path / "a.mp4", 15)
    day = tmp_path / "out" / "day"
    return Run(source, (Output("video", day / "a.mp4"), Output("tracks", day / "a.csv")))


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Work:
    """The model that finds red cars, as a worker gets it: by the name of its file."""
    path = tmp_path_factory.mktemp("model") / "red.npz"
    save_model(red_finder(), path)
    return Work(SETTINGS, path, threads=1)


def test_the_record_says_what_was_done_and_folders_are_made(
    job: Run, work: Work, tmp_path: Path
) -> None:
    before = datetime.now(UTC).replace(microsecond=0)
    record = process_file(job, work=work)
    assert record.error is None
    assert record.input == str(job.source)
    assert record.outputs == {
        "video": str(tmp_path / "out" / "day" / "a.mp4"),
        "tracks": str(tmp_path / "out" / "day" / "a.csv"),
    }
    assert (record.width, record.height, record.frames, record.tracks) == (WIDTH, HEIGHT, 15, 1)
    assert record.warnings == ()
    assert record.seconds > 0
    assert before <= datetime.fromisoformat(record.started) <= datetime.now(UTC)
    assert names(tmp_path / "out") == ["day/a.csv", "day/a.mp4"]
    paths = [output.path for output in job.outputs]
    assert record.sizes == {str(path): path.stat().st_size for path in paths}
    assert record.times == {str(path): path.stat().st_mtime_ns for path in paths}
    assert record.digest == result_digest(work.digest, job.source)


def test_the_detector_is_loaded_once_for_all_files(
    job: Run, work: Work, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded: list[object] = []

    def load(*arguments: Any) -> DetectorModel:
        loaded.append(arguments)
        return load_detector(*arguments)

    monkeypatch.setattr("vdet.batch.task.load_detector", load)
    again = replace(job, overwrite=True)
    for sha256 in ("a", "a", "b"):
        assert process_file(again, work=replace(work, model_sha256=sha256)).error is None
    assert loaded == [(SETTINGS.detector, work.model)] * 2


def test_only_warnings_about_this_file_are_recorded(
    job: Run, work: Work, monkeypatch: pytest.MonkeyPatch
) -> None:
    def warn_and_process(*arguments: object, **options: object) -> object:
        log = logging.getLogger("vdet")
        log.warning("%s: 3 frames damaged", job.source)
        log.warning("%s0: another file, in another thread", job.source)
        log.info("%s: nothing to worry about", job.source)
        return run_video(*arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr("vdet.batch.task.run_video", warn_and_process)
    before = list(logging.getLogger("vdet").handlers)
    assert process_file(job, work=work).warnings == (f"{job.source}: 3 frames damaged",)
    assert logging.getLogger("vdet").handlers == before


def test_an_error_is_recorded_without_numbers(job: Run, work: Work) -> None:
    job.source.write_bytes(b"no video")
    record = process_file(job, work=work)
    assert record.error is not None
    assert record.error.startswith(f"{job.source}: is not a video")
    assert (record.width, record.height, record.frames, record.tracks) == (None,) * 4
    assert (record.digest, record.sizes) == (None, {})


def test_a_file_whose_process_was_killed_has_a_record(job: Run, work: Work) -> None:
    record = record_of_killed(job, work)
    assert record.error is not None
    assert record.error.startswith(f"{job.source}: its process was killed")

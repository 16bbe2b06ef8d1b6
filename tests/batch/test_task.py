"""One file of a batch."""

import logging
from datetime import UTC, datetime
from pathlib import Path

import pytest

from red_cars import HEIGHT, SETTINGS, WIDTH, red_finder
from running import names, write_drive
from vdet.batch.manifest import Record
from vdet.batch.task import process_file, record_of_killed
from vdet.pipeline.loop import VideoJob, run_video


@pytest.fixture
def job(tmp_path: Path) -> VideoJob:
    source = write_drive(tmp_path / "a.mp4", 15)
    return VideoJob(source, tmp_path / "out" / "day" / "a.mp4", tmp_path / "out" / "day" / "a.csv")


def process(job: VideoJob) -> Record:
    return process_file(job, model=red_finder(), settings=SETTINGS, threads=1)


def test_tells_what_was_done_and_makes_the_folders_for_it(job: VideoJob, tmp_path: Path) -> None:
    before = datetime.now(UTC).replace(microsecond=0)
    record = process(job)
    assert record.error is None
    assert (record.input, record.output, record.tracks_output) == (
        str(job.source),
        str(job.video),
        str(job.tracks),
    )
    assert (record.width, record.height, record.frames, record.tracks) == (WIDTH, HEIGHT, 15, 1)
    assert record.warnings == ()
    assert record.seconds > 0
    assert before <= datetime.fromisoformat(record.started) <= datetime.now(UTC)
    assert names(tmp_path / "out") == ["day/a.csv", "day/a.mp4"]


def test_warnings_of_this_file_are_recorded_and_no_others(
    job: VideoJob, monkeypatch: pytest.MonkeyPatch
) -> None:
    def warn_and_process(*arguments: object, **options: object) -> object:
        log = logging.getLogger("vdet")
        log.warning("%s: 3 frames damaged", job.source)
        log.warning("%s0: another file, in another thread", job.source)
        log.info("%s: nothing to worry about", job.source)
        return run_video(*arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr("vdet.batch.task.run_video", warn_and_process)
    before = list(logging.getLogger("vdet").handlers)
    assert process(job).warnings == (f"{job.source}: 3 frames damaged",)
    assert logging.getLogger("vdet").handlers == before


def test_an_error_is_recorded_without_numbers(job: VideoJob) -> None:
    job.source.write_bytes(b"no video")
    record = process(job)
    assert record.error is not None
    assert record.error.startswith(f"{job.source}: is not a video")
    assert (record.width, record.height, record.frames, record.tracks) == (None,) * 4


def test_a_folder_that_cannot_be_made_is_an_error_of_the_file(
    job: VideoJob, tmp_path: Path
) -> None:
    (tmp_path / "out").touch()
    record = process(job)
    assert record.error is not None
    assert "cannot be made a folder" in record.error


def test_with_vdet_debug_a_bug_shows_its_traceback(
    job: VideoJob, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("vdet.batch.task.run_video", None)
    monkeypatch.delenv("VDET_DEBUG", raising=False)
    assert "internal error" in str(process(job).error)
    assert capsys.readouterr().err == ""
    monkeypatch.setenv("VDET_DEBUG", "1")
    process(job)
    assert "Traceback" in capsys.readouterr().err


def test_a_killed_process_is_told_for_it(job: VideoJob) -> None:
    record = record_of_killed(job)
    assert record.error is not None
    assert record.error.startswith(f"{job.source}: its process was killed")

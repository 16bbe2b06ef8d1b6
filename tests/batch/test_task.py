"""One file of a batch."""

import logging
import os
import time
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from red_cars import HEIGHT, WIDTH, red_settings
from running import names, write_drive
from vdet.batch.task import process_file, result_digest
from vdet.detect.detectors import DetectorModel, load_detector
from vdet.plugins import plugin_packages
from vdet.run.sinks import Output
from vdet.run.video import Run, write_outputs


@pytest.fixture
def job(tmp_path: Path) -> Run:
    source = write_drive(tmp_path / "a.mp4", 15)
    day = tmp_path / "out" / "day"
    outputs = Output("video", day / "a.mp4"), Output("tracks", day / "a.csv")
    return Run(source, outputs, red_settings(tmp_path), threads=1)


def test_the_record_says_what_was_done_and_folders_are_made(job: Run, tmp_path: Path) -> None:
    before = datetime.now(UTC).replace(microsecond=0)
    record = process_file(job, folder=tmp_path / "out")
    assert record.error is None
    assert record.input == str(job.source)
    paths = [tmp_path / "out" / "day" / name for name in ("a.mp4", "a.csv")]
    assert [(output.sink, output.path) for output in record.outputs] == [
        ("video", str(paths[0])),
        ("tracks", str(paths[1])),
    ]
    assert (record.width, record.height, record.frames, record.tracks) == (WIDTH, HEIGHT, 15, 1)
    assert record.warnings == ()
    assert record.seconds > 0
    assert before <= datetime.fromisoformat(record.started) <= datetime.now(UTC)
    (note,) = (tmp_path / "out").glob(".vdet-notes/*")
    assert note.read_text() == record.line
    note.unlink()
    assert names(tmp_path / "out") == ["day/a.csv", "day/a.mp4"]
    states = [(path.stat().st_size, path.stat().st_mtime_ns) for path in paths]
    assert [output.state for output in record.outputs] == states
    assert {output.digest for output in record.outputs} == {result_digest(job)}


def test_the_detector_is_loaded_once_for_all_files(
    job: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded: list[object] = []

    def load(*arguments: Any) -> DetectorModel:
        loaded.append(arguments)
        return load_detector(*arguments)

    monkeypatch.setattr("vdet.batch.task.load_detector", load)
    again = replace(job, overwrite=True, outputs=job.outputs[1:])
    for frames in (2, 3):
        assert process_file(replace(again, frames=frames), folder=tmp_path).error is None
    assert loaded == [(job.settings.detector,)]
    (tmp_path / "red.npz").write_bytes((tmp_path / "red.npz").read_bytes())
    os.utime(tmp_path / "red.npz", (0, 0))
    assert process_file(replace(again, frames=4), folder=tmp_path).error is None


def test_warnings_are_recorded(
    job: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """They are not printed by the process: whoever gets the record does it, once."""

    def warn_and_process(*arguments: object, **options: object) -> object:
        log = logging.getLogger("vdet")
        log.warning("%s: 3 frames damaged", job.source)
        log.info("%s: nothing to worry about", job.source)
        return write_outputs(*arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr("vdet.batch.task.write_outputs", warn_and_process)
    before = list(logging.getLogger("vdet").handlers)
    assert process_file(job, folder=tmp_path / "out").warnings == (
        f"{job.source}: 3 frames damaged",
    )
    assert logging.getLogger("vdet").handlers == before
    assert "frames damaged" not in capfd.readouterr().err


def test_the_digest_changes_with_the_version_of_a_package_with_plugins(
    job: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    digests = [result_digest(job)]
    for version in ("1.0", "1.1"):
        info = tmp_path / version / "follows.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(f"Name: follows\nVersion: {version}\n")
        (info / "entry_points.txt").write_text("[vdet.steps]\nfollow = follows:step\n")
        monkeypatch.syspath_prepend(info.parent)
        plugin_packages.cache_clear()
        digests.append(result_digest(job))
    plugin_packages.cache_clear()
    assert len(set(digests)) == 3


def test_the_digest_changes_with_the_time_zone(job: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """Clocks without a zone are those of this computer."""
    digests = set()
    for zone in ("UTC", "Europe/Berlin", "UTC"):
        monkeypatch.setenv("TZ", zone)
        time.tzset()
        digests.add(result_digest(job))
    assert len(digests) == 2
    monkeypatch.undo()
    time.tzset()

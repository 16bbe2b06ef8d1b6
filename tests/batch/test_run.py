"""A batch and each of its files: records, the manifest, totals, and what a kill leaves."""

import json
import logging
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from joblib.parallel import SequentialBackend

from red_cars import HEIGHT, WIDTH, red_settings
from running import names, write_drive
from vdet.batch import (
    ManifestRecord,
    Plan,
    Written,
    make_plan,
    open_manifest,
    process_file,
    read_batch,
    result_digest,
    run_batch,
)
from vdet.detect.detectors import DetectorModel, load_detector
from vdet.errors import BatchError, OutputError
from vdet.plugins import plugin_packages
from vdet.run.sinks import Output, data
from vdet.run.sinks.protocol import BatchTotal
from vdet.run.video import Run, write_outputs
from vdet.workers import LocalProcesses


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
    assert [(output.bytes, output.changed) for output in record.outputs] == states
    assert {output.digest for output in record.outputs} == {result_digest(job)}


def test_the_detector_is_loaded_once_for_all_files(
    job: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded: list[object] = []

    def load(*arguments: Any) -> DetectorModel:
        loaded.append(arguments)
        return load_detector(*arguments)

    monkeypatch.setattr("vdet.batch.load_detector", load)
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

    monkeypatch.setattr("vdet.batch.write_outputs", warn_and_process)
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


RECORD = ManifestRecord(
    "/in/\udcff \n\U0001f697.mp4",
    "2026-01-02T03:04:05+00:00",
    seconds=1.5,
    model="net.onnx",
    model_sha256="12ab",
    width=4,
    height=3,
    frames=2,
    tracks=1,
    outputs=(Written("tracks", "/out/a.csv", 70, 123_456, "digest", [1]),),
    program="vdet 1.2",
)


def lines(path: Path) -> list[str]:
    return path.read_text().splitlines()


@pytest.mark.parametrize("broken", [RECORD.line[:50], "[" * 200_000 + "\n"])
def test_a_broken_line_is_skipped_and_does_not_spoil_the_next_one(
    tmp_path: Path, broken: str
) -> None:
    """A power cut may leave half of one."""
    (tmp_path / "manifest.jsonl").write_text(RECORD.line + broken)
    with open_manifest(tmp_path) as add:
        add(RECORD)
    assert [record.line for record in read_batch(tmp_path)] == [RECORD.line, RECORD.line]


def test_a_record_is_there_as_soon_as_it_is_added(tmp_path: Path) -> None:
    path = tmp_path / "manifest.jsonl"
    with open_manifest(tmp_path) as add:
        add(RECORD)
        (line,) = lines(path)
        add(RECORD)
    output = {"sink": "tracks", "path": "/out/a.csv", "bytes": 70, "changed": 123_456}
    assert json.loads(line) == {
        "input": RECORD.input, "started": "2026-01-02T03:04:05+00:00", "seconds": 1.5,
        "model": "net.onnx", "model_sha256": "12ab", "width": 4, "height": 3, "frames": 2,
        "tracks": 1, "begin": None, "facts": {}, "warnings": [], "error": None,
        "outputs": [output | {"digest": "digest", "summary": [1]}], "program": "vdet 1.2",
    }  # fmt: skip
    assert len(lines(path)) == 2


def test_a_disk_that_is_full_is_named(tmp_path: Path) -> None:
    (tmp_path / "manifest.jsonl").symlink_to("/dev/full")
    words = r"manifest\.jsonl: cannot be written: No space left on"
    with pytest.raises(OutputError, match=words), open_manifest(tmp_path) as add:
        add(RECORD)


def test_a_second_batch_into_the_folder_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "manifest.jsonl"

    def open_again() -> None:
        with open_manifest(tmp_path):
            pass

    with open_manifest(tmp_path) as add:
        with pytest.raises(OutputError, match=r"manifest\.jsonl: another batch is writing here"):
            open_again()
        add(RECORD)
    open_again()
    assert len(lines(path)) == 1


OUTPUTS = Output("tracks", Path(".csv")), Output("vehicles", Path(".cars.json"))


MakePlan = Callable[..., Plan]


class InTurn(LocalProcesses):
    """This process in place of others: the calls are made in turn."""

    @contextmanager
    def open(self) -> Iterator[SequentialBackend]:
        yield SequentialBackend()


@pytest.fixture
def clips(tmp_path: Path) -> Path:
    for name in ("a", "b"):
        (tmp_path / "in" / name).mkdir(parents=True)
        write_drive(tmp_path / "in" / name / "c.mp4", 15)
    return tmp_path / "in"


@pytest.fixture
def plan(clips: Path) -> MakePlan:
    """A function that plans a batch of all clips into the folder `out`."""
    common = Run(Path(), OUTPUTS, red_settings(clips.parent), threads=1)
    return partial(make_plan, [clips], clips.parent / "out", common)


def run(planned: Plan) -> list[str | None]:
    return [record.error for _, record in run_batch(planned, workers=InTurn(1))]


MADE = ["a/c.cars.json", "a/c.csv", "all.cars.json", "b/c.cars.json", "b/c.csv", "manifest.jsonl"]


def test_a_total_has_what_is_known_of_all_videos_also_of_those_skipped(
    clips: Path, plan: MakePlan
) -> None:
    out = clips.parent / "out"
    assert run(plan()) == [None, None]
    assert names(out) == MADE
    total = json.loads((out / "all.cars.json").read_text())
    assert total == [
        {"video": f"{name}/c", **car}
        for name in ("a", "b")
        for car in json.loads((out / name / "c.cars.json").read_text())
    ]
    assert total
    (out / "all.cars.json").unlink()
    (out / "b" / "c.csv").unlink()
    again = plan(skip_existing=True)
    assert (len(again.runs), len(again.skipped)) == (1, 1)
    assert run(again) == [None]
    assert json.loads((out / "all.cars.json").read_text()) == total


def test_what_was_made_before_the_program_was_killed_is_skipped(
    clips: Path, plan: MakePlan
) -> None:
    """The worker has given the outputs their names, and there is no line of the manifest yet."""
    out, first = clips.parent / "out", plan().runs[0]
    assert process_file(first, folder=out).error is None
    again = plan(skip_existing=True)
    assert [run.source for run in again.skipped] == [first.source]
    assert run(again) == [None]
    assert names(out) == MADE
    inputs = [
        json.loads(line)["input"] for line in (out / "manifest.jsonl").read_text().splitlines()
    ]
    assert sorted(inputs) == [str(clips / name / "c.mp4") for name in ("a", "b")]


def test_outputs_of_which_a_kill_left_some_are_made_again(clips: Path, plan: MakePlan) -> None:
    out, first = clips.parent / "out", plan().runs[0]
    process_file(first, folder=out)
    first.outputs[1].path.unlink()
    assert plan(skip_existing=True).runs[0].overwrite
    assert process_file(first, folder=out).error is None
    first.outputs[1].path.write_text("corrected by hand")
    with pytest.raises(BatchError, match=r"c\.cars\.json: has changed since vdet wrote it"):
        plan(skip_existing=True)


def test_a_file_whose_process_was_killed_is_made_once(clips: Path, plan: MakePlan) -> None:
    out, first = clips.parent / "out", plan().runs[0]
    record = process_file(first, folder=out)
    assert process_file(first, folder=out).line == record.line


@pytest.mark.parametrize("has_note", [True, False])
def test_a_foreign_file_is_kept_also_when_a_process_was_killed(
    clips: Path, plan: MakePlan, has_note: bool
) -> None:
    out, first = clips.parent / "out", plan().runs[0]
    if has_note:
        process_file(first, folder=out)
    path = first.outputs[0].path
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("theirs")
    words = "has changed since vdet wrote it" if has_note else "appeared during the run"
    assert f"{path}: {words}" in str(process_file(first, folder=out).error)
    assert path.read_text() == "theirs"


def test_a_total_that_cannot_be_made_leaves_nothing(
    clips: Path, plan: MakePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: object, target: Path) -> None:
        target.write_text("half")
        raise OSError(28, "No space left on device")

    def replaced(**changes: Any) -> None:
        monkeypatch.setattr(data, "vehicles", replace(data.vehicles, **changes))

    replaced(total=BatchTotal("all", fail))
    with pytest.raises(OutputError, match=r"all.cars.json: .*No space left"):
        run(plan())
    assert names(clips.parent / "out") == [name for name in MADE if "all" not in name]

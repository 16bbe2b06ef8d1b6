"""A batch: its records, the files over all videos, and what a kill between two steps leaves."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from joblib.parallel import SequentialBackend

from red_cars import red_settings
from running import names, write_drive
from vdet.batch.run import Plan, make_plan, run_batch
from vdet.batch.task import process_file
from vdet.errors import BatchError, OutputError
from vdet.run.sinks import Output, data
from vdet.run.sinks.protocol import BatchTotal
from vdet.run.video import Run
from vdet.workers import LocalProcesses

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
        monkeypatch.setattr(data, "VEHICLES", replace(data.VEHICLES, **changes))

    replaced(total=BatchTotal("all", fail))
    with pytest.raises(OutputError, match=r"all.cars.json: .*No space left"):
        run(plan())
    assert names(clips.parent / "out") == [name for name in MADE if "all" not in name]

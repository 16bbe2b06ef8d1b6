"""Every item is done once, whatever happens to the processes; here the processes are simulated."""

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import pytest

from running import write_drive
from vdet.batch.plan import OutputSuffix, Plan, PlannedTotal, make_plan
from vdet.batch.run import each_once, run_batch, write_totals
from vdet.batch.task import Identity
from vdet.errors import OutputError
from vdet.run.sinks.protocol import BatchTotal, VideoPart
from vdet.run.video import Run
from vdet.workers import WorkerKilledError

T = TypeVar("T")
R = TypeVar("R")


@dataclass
class FakeWorkers:
    """Have `count` items in work at a time; a deadly item kills all that are in work with it."""

    count: int
    deadly: Sequence[object] = ()
    kills_left: int = 1000
    calls: list[list[object]] = field(default_factory=list)

    def map(self, function: Callable[[T], R], items: Sequence[T]) -> Generator[tuple[int, R]]:
        self.calls.append([])
        in_work: list[tuple[int, R]] = []
        for number, item in enumerate(items):
            in_work.append((number, function(item)))
            self.calls[-1].append(item)
            if item in self.deadly and self.kills_left:
                self.kills_left -= 1
                raise WorkerKilledError(number for number, _ in in_work)
            if len(in_work) == self.count:
                yield in_work.pop(0)
        yield from in_work


def same(item: int) -> int:
    return item


@pytest.mark.parametrize("count", [1, 2, 4])
def test_only_items_that_kill_their_process_have_no_result(count: int) -> None:
    items = list(range(10))
    results = dict(each_once(same, items, FakeWorkers(count, deadly=[3, 7]), same))
    assert results == {item: None if item in (3, 7) else item for item in items}


def test_items_that_were_in_work_when_a_process_was_killed_are_repeated_one_by_one() -> None:
    workers = FakeWorkers(2, deadly=[3], kills_left=1)
    results = dict(each_once(same, range(6), workers, same))
    assert results == {item: item for item in range(6)}
    assert workers.calls == [[0, 1, 2, 3], [4, 5], [2], [3]]


def test_what_is_repeated_may_differ_and_counts_for_its_item() -> None:
    workers = FakeWorkers(2, deadly=[3], kills_left=1)
    results = dict(each_once(same, range(4), workers, lambda item: item + 10))
    assert results == {0: 0, 1: 1, 2: 12, 3: 13}


def test_a_file_that_ended_when_its_process_was_killed_is_made_again(tmp_path: Path) -> None:
    clip = write_drive(tmp_path / "clip.mp4", 3)
    outputs = [OutputSuffix("tracks", ".csv")]
    plan = make_plan([clip], tmp_path / "out", Run(Path()), outputs)
    workers = FakeWorkers(1, deadly=plan.runs, kills_left=1)
    ((job, record),) = run_batch(plan, workers=workers)
    assert len(workers.calls) == 2
    assert record.error is None
    assert all(output.path.exists() for output in job.outputs)


def join(parts: Mapping[str, VideoPart], target: Path) -> None:
    lines = (f"{name}: {part.path.read_text()} in {part.place}\n" for name, part in parts.items())
    target.write_text("".join(lines))


def test_a_total_is_made_from_the_outputs_that_are_there(tmp_path: Path) -> None:
    outputs = {name: tmp_path / f"{name}.txt" for name in ("a", "failed", "b")}
    for name in ("a", "b"):
        outputs[name].write_text(f"of {name}")
    total = PlannedTotal(BatchTotal("all", join), tmp_path / "all.txt", outputs)
    (tmp_path / "all.txt").write_text("of an earlier run")
    write_totals(Plan(tmp_path, Identity(""), (), (), (total,)))
    assert (tmp_path / "all.txt").read_text() == "a: of a in a.txt\nb: of b in b.txt\n"


def test_a_total_that_cannot_be_made_leaves_nothing(tmp_path: Path) -> None:
    def fail(_: Mapping[str, VideoPart], target: Path) -> None:
        target.write_text("half")
        raise OSError(28, "No space left on device")

    total = PlannedTotal(BatchTotal("all", fail), tmp_path / "all.txt", {})
    with pytest.raises(OutputError, match=r"all.txt: .*No space left"):
        write_totals(Plan(tmp_path, Identity(""), (), (), (total,)))
    assert list(tmp_path.iterdir()) == []

"""Sinks in a run: each gets every result, and all leave their outputs or none does."""

import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import pytest

from run.conftest import Register
from run.red_runs import COUNT, outputs, read, run_red
from vdet.boxes import Image
from vdet.errors import OutputError
from vdet.files import OutputFiles
from vdet.findings import Findings
from vdet.run.sinks import Output
from vdet.run.sinks.protocol import BaseSink, SinkContext, SinkKind, check_sinks
from vdet.run.steps import FrameResult
from vdet.run.video import Run


@dataclass
class Collects:
    """A sink that keeps what it gets: the results, and a copy of each image."""

    results: list[FrameResult] = field(default_factory=list)
    images: list[Image] = field(default_factory=list)
    entered: int = 0
    left: list[type[BaseException] | None] = field(default_factory=list)

    def __enter__(self) -> Self:
        self.entered += 1
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.left.append(kind)

    def write(self, result: FrameResult) -> None:
        self.results.append(result)
        self.images.append(result.frame.image.copy())


@pytest.fixture
def collect(register: Register) -> Callable[[str], Collects]:
    """Register a sink that keeps what it gets."""

    def collect(name: str) -> Collects:
        sink = Collects()
        register(name, SinkKind(lambda *_: sink))
        return sink

    return collect


def test_every_sink_gets_each_result_once_and_in_order(
    red_clip: Path, tmp_path: Path, collect: Callable[[str], Collects]
) -> None:
    first, last = collect("first"), collect("last")
    wanted = (
        Output("first", tmp_path / "first"),
        *outputs(video=tmp_path / "a.mp4", tracks=tmp_path / "a.csv"),
        Output("last", tmp_path / "last"),
    )
    run_red(Run(red_clip, wanted, threads=3))
    for sink in (first, last):
        assert [result.frame.index for result in sink.results] == list(range(COUNT))
        assert (sink.entered, sink.left) == (1, [None])
    assert all(one is other for one, other in zip(first.results, last.results, strict=True))
    assert any(result.tracks for result in last.results)


@dataclass
class Fragile:
    """A sink that writes a line a frame, and fails at a moment, once."""

    path: Path
    context: SinkContext
    fails_at: str
    count: int = 0

    def fail_at(self, moment: str) -> None:
        if moment == self.fails_at:
            raise OSError(28, "No space left on device")

    def __enter__(self) -> Self:
        self.file = self.context.files.stage(self.path).open("w")
        try:
            self.fail_at("enter")
        except BaseException:
            self.file.close()
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.file.close()
        if kind is None:
            self.fail_at("end")

    def write(self, result: FrameResult) -> None:
        self.count += 1
        self.file.write(f"{result.frame.index}\n")
        if self.count in (1, 11):
            self.fail_at("first" if self.count == 1 else "middle")


@pytest.mark.parametrize("place", ["before the others", "after the others"])
@pytest.mark.parametrize("moment", ["open", "enter", "first", "middle", "end"])
def test_if_one_sink_fails_no_output_appears_and_the_same_job_runs_again(
    red_clip: Path, register: Register, tmp_path: Path, moment: str, place: str
) -> None:
    def open_it(path: Path, context: SinkContext) -> Fragile:
        sink = Fragile(path, context, moment)
        sink.fail_at("open")
        return sink

    folders = {name: tmp_path / name for name in ("stages", "page", "crops")}
    wanted = outputs(video=tmp_path / "out.mp4", tracks=tmp_path / "out.csv", **folders)
    fragile = Output("fragile", tmp_path / "fragile.txt")
    in_order = (fragile, *wanted) if "before" in place else (*wanted, fragile)
    job, threads = Run(red_clip, in_order, frames=20), threading.active_count()
    register("fragile", SinkKind(open_it))
    words = f"^{fragile.path}: cannot be written: No space left on device$"
    with pytest.raises(OutputError, match=words):
        run_red(job)
    assert list(tmp_path.iterdir()) == []
    assert threading.active_count() == threads
    register("fragile", SinkKind(lambda path, context: Fragile(path, context, "never")))
    run_red(job)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"fragile.txt", "out.csv", "out.mp4", "stages", "page", "crops"}
    assert fragile.path.read_text().split() == [str(n) for n in range(20)]
    assert len(read(tmp_path / "out.mp4")) == 20
    assert len(list((tmp_path / "stages").iterdir())) == 6


@dataclass(frozen=True)
class MostAtOnce:
    """A fact about a whole video."""

    vehicles: int

    def __str__(self) -> str:
        return f"shows {self.vehicles} vehicle at once"

    def record(self) -> dict[str, int]:
        return {"vehicles": self.vehicles}


class CountsMost:
    """A step that finds out the largest number of tracks in a frame."""

    most = 0

    def apply(self, result: FrameResult) -> FrameResult:
        self.most = max(self.most, len(result.tracks))
        return result

    def finish(self) -> dict[str, MostAtOnce]:
        return {"most": MostAtOnce(self.most)}


def test_what_a_step_finds_out_of_a_video_reaches_its_sinks_totals_and_warnings(
    red_clip: Path, tmp_path: Path, register: Register, caplog: pytest.LogCaptureFixture
) -> None:
    seen: list[object] = []

    class Reads(BaseSink):
        def write(self, _: FrameResult) -> None:
            assert not self.context.facts

        def finish(self) -> None:
            seen.append(dict(self.context.facts))

    register("reads", SinkKind(Reads))
    totals = run_red(Run(red_clip, outputs(reads=tmp_path / "a")), steps=[CountsMost()])
    assert totals.facts == {"conditions": Findings(), "most": MostAtOnce(1)}
    assert seen == [totals.facts]
    assert f"{red_clip}: shows 1 vehicle at once" in caplog.messages


def test_a_folder_that_was_written_before_is_refused(tmp_path: Path) -> None:
    (tmp_path / "3-boxes.png").touch()
    with pytest.raises(OutputError, match=r"3-boxes\.png: already exists"):
        check_sinks([Output("stages", tmp_path)], OutputFiles())
    check_sinks([Output("stages", tmp_path)], OutputFiles(overwrite=True))

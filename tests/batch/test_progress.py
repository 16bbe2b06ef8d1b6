"""Progress of a batch: frames of all files, and the time that is left."""

from pathlib import Path

import pytest

from running import write_drive
from vdet.batch.manifest import Origin
from vdet.batch.plan import OutputOptions, OutputSuffix, make_plan
from vdet.batch.progress import BatchState, FrameCounts, batch_state, frame_counts
from vdet.batch.run import run_batch
from vdet.batch.task import Work
from vdet.config.schema import Settings
from vdet.run.video import VideoJob
from vdet.workers import ThisProcess


def state(
    *files: tuple[float, int, int, bool], sizes: tuple[float, ...] | None = None, now: float = 110
) -> BatchState:
    """Return the state of files `(begun, done, expected, ended)` of a batch begun at 100 s."""
    with frame_counts(len(files)) as counts:
        rows = counts.rows()
        for number, file in enumerate(files):
            rows[number] = file
        return batch_state(rows, sizes or (1,) * len(files), 100, now)


WAITING = (0.0, 0, 0, False)


def test_frames_of_files_that_are_not_begun_are_guessed_from_their_sizes() -> None:
    found = state((100, 30, 30, True), (105, 20, 70, False), WAITING, sizes=(3, 7, 20))
    assert (found.done, found.total, found.ended) == (50, 300, 1)
    ((number, share),) = found.running
    assert number == 1
    assert share == pytest.approx(20 / 70)


def test_the_time_left_is_that_of_all_frames_at_the_rate_so_far() -> None:
    both = (100, 50, 100, False)
    found = state(both, both, WAITING, WAITING)
    assert found.seconds_left == pytest.approx(300 / 10)  # 10 frames/s together


def test_the_last_long_file_is_not_done_faster_than_it_goes() -> None:
    found = state((100, 900, 900, True), (100, 100, 300, False))
    assert found.seconds_left == pytest.approx(20)  # not 200 frames at 100 frames/s


def test_before_the_first_frame_nothing_is_known() -> None:
    assert state(WAITING, WAITING) == BatchState(0, 0, 0, None, ())
    assert state((100, 0, 50, False)).seconds_left is None


def test_a_video_of_unknown_length_is_running() -> None:
    found = state((100, 40, 0, False))
    assert (found.done, found.total) == (40, 40)
    assert found.running == ((0, 1.0),)


def test_a_failed_file_leaves_nothing_to_do() -> None:
    with frame_counts(1) as counts:
        counts.progress_of(0)(100)(30)
        counts.end(0, None)
        found = batch_state(counts.rows(), (1,), 100, 110)
    assert (found.done, found.total, found.ended, found.seconds_left) == (30, 30, 1, 0)


def test_where_the_counts_cannot_be_seen_nothing_is_counted(tmp_path: Path) -> None:
    FrameCounts(tmp_path / "elsewhere", 1).progress_of(0)(10)(1)
    assert not list(tmp_path.iterdir())


def test_a_batch_counts_the_frames_of_each_file_while_it_runs(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    clips = [write_drive(tmp_path / "in" / name, n) for name, n in (("a.mp4", 3), ("b.mp4", 5))]
    plan = make_plan(
        clips, tmp_path / "out", VideoJob(Path()), OutputOptions([OutputSuffix("tracks", ".csv")])
    )
    work = Work(Settings(), None, threads=1)
    with frame_counts(2) as counts:
        results = run_batch(
            plan, work, Origin("", None, None), workers=ThisProcess(), counts=counts
        )
        next(results)
        first = batch_state(counts.rows(), (3, 5), 0, 1)
        assert (first.done, first.total, first.ended) == (3, 8, 1)
        list(results)
        assert batch_state(counts.rows(), (3, 5), 0, 1).done == 8

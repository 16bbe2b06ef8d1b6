"""Progress of a batch: frames of all files."""

from dataclasses import replace
from pathlib import Path

from running import write_drive
from vdet.batch.plan import OutputSuffix, make_plan
from vdet.batch.progress import FrameCounts, frame_counts
from vdet.batch.run import run_batch
from vdet.batch.task import Work
from vdet.config.schema import Settings
from vdet.run.video import VideoJob
from vdet.workers import ThisProcess


def test_frames_of_files_that_are_not_begun_are_guessed_from_their_sizes(tmp_path: Path) -> None:
    jobs = []
    for name, size in (("a", 3), ("b", 7), ("c", 20)):
        (tmp_path / name).write_bytes(bytes(size))
        jobs.append(VideoJob(tmp_path / name))
    with frame_counts(jobs) as counts:
        assert counts is not None
        assert counts.state() == (0, 0, 0)
        counts.progress_of(0)(30)(30)
        counts.end(0, 30)
        counts.progress_of(1)(70)(20)
        assert counts.state() == (50, 300, 1)
    with frame_counts([replace(job, frames=9) for job in jobs]) as limited:
        assert limited is not None
        limited.progress_of(0)(9)
        assert limited.state()[1] == 27, "as much is read of each"


def test_where_the_counts_cannot_be_seen_nothing_is_counted(tmp_path: Path) -> None:
    FrameCounts(tmp_path / "elsewhere", (1,)).progress_of(0)(10)(1)
    assert not list(tmp_path.iterdir())


def test_a_batch_counts_the_frames_of_each_file_while_it_runs(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    clips = [write_drive(tmp_path / "in" / name, n) for name, n in (("a.mp4", 3), ("b.mp4", 5))]
    suffixes = [OutputSuffix("tracks", ".csv")]
    plan = make_plan(clips, tmp_path / "out", VideoJob(Path()), suffixes)
    with frame_counts(plan.jobs) as counts:
        assert counts is not None
        results = run_batch(plan, Work(Settings(), threads=1), workers=ThisProcess(), counts=counts)
        next(results)
        assert counts.state()[::2] == (3, 1)
        list(results)
        assert counts.state() == (8, 8, 2)

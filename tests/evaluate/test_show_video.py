from pathlib import Path

from labels.saving import checked_video, row
from vdet.evaluate.output import RunName
from vdet.evaluate.show_video import plain, result_lines, video_page
from vdet.evaluate.video import RunResult, best, score_files, score_video
from vdet.labels.video import LabelledVideo

TEN = range(1, 11)
NAME = RunName("svm", None, None, ("b=1",))


def video(frames: range, x: float = 0) -> LabelledVideo:
    return checked_video([row(0, frame, 1, x, 0, 100, 100) for frame in frames])


def run(assignments: tuple[str, ...], *found: range) -> RunResult:
    """Return a run over as many clips; in each the vehicle is found in these of ten frames."""
    clips = [score_video(f"clip {i}", video(frames), video(TEN)) for i, frames in enumerate(found)]
    return RunResult.of(assignments, clips)


def write(path: Path, frames: range, ending: str) -> Path:
    path.write_text("".join(f"{frame},1,1,1,100,100,{ending}\n" for frame in frames))
    return path


def test_several_clips_have_a_row_each_and_a_total() -> None:
    lines = list(result_lines([run((), TEN, range(1, 6))]))
    assert [line.split("  ")[0] for line in lines[1:4]] == ["clip 0", "clip 1", "total"]
    assert any(line.startswith("largest of 1 mistake in clip 1") for line in lines)


def test_a_sweep_has_a_row_for_each_setting_and_names_the_best() -> None:
    runs = [run(("a=1", "b=2"), range(1, 6)), run(("a=2", "b=2"), TEN)]
    assert best(runs) is runs[1]
    assert list(result_lines(runs))[-1] == "best F1: a=2 b=2 (1.000)"


def test_plain_values_of_one_run_and_of_a_sweep() -> None:
    one = plain([run((), TEN)], NAME)
    assert (one["detector"], one["set"]) == ("svm", ["b=1"])
    assert one["total"]["f1"] == one["videos"][0]["f1"] == 1
    two = plain([run(("a=1",), TEN), run(("a=[x=1]",), TEN)], NAME)
    assert [each["settings"] for each in two["sweep"]] == [{"a": "1"}, {"a": "[x=1]"}]


def test_only_frames_that_the_truth_covers_are_compared_and_the_others_are_reported(
    tmp_path: Path,
) -> None:
    found = write(tmp_path / "found.txt", range(1, 21), "1,-1,-1,-1")
    truth = write(tmp_path / "gt.txt", TEN, "1,3,1")
    covered = score_files(found, truth)
    assert (covered.total.false_positives, covered.clips[0].left_out) == (0, 10)
    line = f"{found}: frames 1–10 compared; left out: 10 boxes found in later ones"
    assert line in result_lines([covered])
    assert line in video_page([covered], "")
    longer = score_files(found, truth, until=15)
    assert (longer.total.false_positives, longer.clips[0].left_out) == (5, 5)

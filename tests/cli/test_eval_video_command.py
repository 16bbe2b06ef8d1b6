"""`vdet eval video`."""

import json
from pathlib import Path

import vdet
from conftest import Run
from quick import QUICK_OPTIONS


def test_scores_agree_with_those_of_the_tracks_written(
    run: Run, clip_path: Path, truth_path: Path, model_path: Path, tmp_path: Path
) -> None:
    tracks, folder = tmp_path / "found.jsonl", tmp_path / "page"
    common = ("--model", model_path, *QUICK_OPTIONS)
    made = ("--no-video", "--tracks", tracks, "--frames", "9")
    run("detect-video", clip_path, *made, *common, code=0)
    options = ("--truth", truth_path, "--json", "-", "--page", folder)
    from_video = run("eval", "video", clip_path, *options, *common, code=0)
    total = json.loads(from_video.out)["total"]
    again = run("eval", "tracks", tracks, truth_path, "--json", "-")
    from_tracks = json.loads(again.out)
    assert total["track_boxes"] > 0, "nothing was found: the test would say nothing"
    assert {key: from_tracks[key] for key in total} == total
    assert "data:image/jpeg" in (folder / "page.html").read_text()


def test_several_videos_have_a_row_each_and_a_total(
    run: Run, clip_path: Path, truth_path: Path, model_path: Path, tmp_path: Path
) -> None:
    videos = (clip_path, clip_path, "--truth", truth_path, "--truth", truth_path, "--until", "4")
    target = tmp_path / "s.json"
    options = ("--json", target, "--model", model_path, *QUICK_OPTIONS)
    result = run("eval", "video", *videos, *options, code=0)
    values = json.loads(target.read_text())
    first, second = values["videos"]
    assert first == second
    assert (first["video"], first["until"]) == (str(clip_path), 4)
    assert values["total"]["track_boxes"] == 2 * first["track_boxes"] > 0
    name = f"vdet {vdet.__version__}, detector svm, model {model_path.name}, settings "
    assert name in result.out
    assert "total" in result.out

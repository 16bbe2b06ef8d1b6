"""`--corrections` of `vdet count` and `vdet detect-video`, and `vdet eval counts`."""

import json
from pathlib import Path

from cli.test_count_command import LINES, write_tracks
from conftest import Run
from running import rows_of, write_drive

HEAD = """
video: red.mp4
size: [320, 240]
lines: [{name: gate, start: [100, 0], end: [100, 240], left: out, right: in}]
checked: [{line: gate, start: 0.0, end: 60.0}]
events:
"""
MISSED = "  - {line: gate, time: 0.1, direction: in, class: truck, error: missed}\n"


def test_counts_are_corrected_and_are_truth_for_others(run: Run, tmp_path: Path) -> None:
    tracks = write_tracks(tmp_path / "t.csv")
    (tmp_path / "lines.yaml").write_text(LINES)
    review = tmp_path / "c.yaml"
    review.write_text(HEAD + MISSED)
    plain, fixed = tmp_path / "plain.csv", tmp_path / "fixed.json"
    count = ("count", tracks, "-c", tmp_path / "lines.yaml")
    run(*count, "--counts", plain, code=0)
    result = run(*count, "--counts", fixed, "--corrections", review, code=0)
    assert result.out.endswith("corrected: 1 event, by c.yaml\n")
    content = json.loads(fixed.read_text())
    assert content["corrected"] == {
        "events": 1,
        "files": ["c.yaml"],
        "checked": [{"line": "gate", "start": 0.0, "end": 60.0}],
    }
    assert sum(row["count"] for row in content["totals"] if row["name"] == "gate") == 2
    scores = tmp_path / "scores.json"
    result = run("eval", "counts", plain, fixed, "--json", scores, code=0)
    assert result.out.splitlines()[-1].split() == [
        "all", "all", "all", "2", "1", "1", "0", "0", "50.0", "50.0",
    ]  # fmt: skip
    assert len(json.loads(scores.read_text())["counts"]) == 5
    result = run("eval", "counts", fixed, plain, code=1)
    assert "plain.csv: is not JSON" in result.err
    result = run(*count, tracks.with_name("u.csv"), "--corrections", review, code=2)
    assert "--corrections is for one file of tracks" in result.err


def test_a_run_corrects_its_counts_and_its_page(
    run: Run, tmp_path: Path, red: tuple[str, ...]
) -> None:
    clip = write_drive(tmp_path / "red.mp4", 60)
    (tmp_path / "lines.yaml").write_text(LINES)
    review = tmp_path / "c.yaml"
    review.write_text(HEAD + MISSED)
    detect = ("detect-video", clip, "--no-video", *red, "-c", tmp_path / "lines.yaml")
    out = ("--counts", tmp_path / "c.csv", "--page", tmp_path / "page", "--corrections", review)
    result = run(*detect, *out, code=0)
    assert f"{clip}: corrected: 1 event, by c.yaml" in result.err
    assert [row["class"] for row in rows_of(tmp_path / "c.csv")].count("truck") == 1
    page = (tmp_path / "page" / "page.html").read_text()
    assert "These counts are corrected: 1 event, by c.yaml." in page
    review.write_text(HEAD.replace("red.mp4", "other.mp4") + MISSED)
    result = run(*detect, "--counts", tmp_path / "d.csv", "--corrections", review, code=1)
    assert "c.yaml: corrects other.mp4, not red.mp4" in result.err
    assert not (tmp_path / "d.csv").exists()
    result = run("detect-video", clip, "-d", tmp_path / "d", "--corrections", review, code=2)
    assert "--corrections is for one video, without -d" in result.err

"""`--corrections` of `vdet count` and `vdet detect-video`, and `vdet eval counts`."""

import json
from pathlib import Path

import pytest

from browser import browser, downloaded
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
COUNTED = "  - {line: gate, time: 0.52, direction: out, class: vehicle, id: 1}\n"
MISSED = "  - {line: gate, time: 0.1, direction: in, class: truck, error: missed}\n"
WRONG = COUNTED.replace("}", ", error: class, correct: bus}")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the video of a red car, and lines."""
    write_drive(tmp_path / "red.mp4", 60)
    (tmp_path / "lines.yaml").write_text(LINES)
    return tmp_path


def test_corrections_are_truth_for_any_counts_of_the_video(run: Run, folder: Path) -> None:
    tracks, plain, review = folder / "t.csv", folder / "plain.csv", folder / "c.yaml"
    write_tracks(tracks)
    review.write_text(HEAD + COUNTED + MISSED)
    count = ("count", tracks, "-c", folder / "lines.yaml")
    run(*count, "--counts", plain, code=0)
    scores = folder / "scores.json"
    result = run("eval", "counts", plain, review, "--json", scores, code=0)
    assert [line.split() for line in result.out.splitlines()[1:]] == [
        ["gate", "in", "truck", "1", "0", "1", "0", "0", "0.0", "0.0"],
        ["gate", "in", "all", "1", "0", "1", "0", "0", "0.0", "0.0"],
        ["gate", "out", "vehicle", "1", "1", "0", "0", "0", "100.0", "100.0"],
        ["gate", "out", "all", "1", "1", "0", "0", "0", "100.0", "100.0"],
        ["all", "all", "all", "2", "1", "1", "0", "0", "50.0", "50.0"],
    ]
    assert len(json.loads(scores.read_text())["counts"]) == 5
    review.write_text(HEAD + WRONG)
    result = run("eval", "counts", plain, review, code=0)
    assert result.out.splitlines()[-1].split()[3:] == ["1", "1", "0", "0", "1", "100.0", "0.0"]
    result = run(*count, "--corrections", review, "--class", "bus", code=0)
    assert result.out.splitlines()[1].split()[1:9] == ["gate", "out", *"011", "(1", "to", "1)"]
    for table, fault in (
        ("time,name,direction,class,id\nsoon,gate,in,,1\n", ":2: time: must be a valid number"),
        ("video,time,name,direction,class,id\na,1,gate,in,car,1\n", ": has several videos"),
        ("", ": must have the columns time, name, direction, class, id"),
    ):
        plain.write_text(table)
        assert f"{plain}{fault}" in run("eval", "counts", plain, review, code=1).err
    review.write_text(HEAD.replace("checked: [{line: gate, start: 0.0, end: 60.0}]", "") + COUNTED)
    result = run("eval", "counts", plain, review, code=1)
    assert "c.yaml: nothing was checked" in result.err


def test_several_videos_have_corrections_of_their_own(run: Run, folder: Path) -> None:
    paths = [folder / "a.jsonl", folder / "b.jsonl"]
    car = {"id": 1, "y": 100, "width": 40, "height": 40, "score": 0.9, "state": "detected"}
    for path in paths:
        video = {"name": f"{path.stem}.mp4", "width": 320, "height": 240}
        frames = [{"frame": n, "time": n / 25, "tracks": [car | {"x": 4 * n}]} for n in range(50)]
        path.write_text("\n".join(map(json.dumps, [{"video": video, **frames[0]}, *frames[1:]])))
    review, totals = folder / "b.yaml", folder / "totals.json"
    by_whom = "reviewer: Ann\nsaved: 2026-05-01 10:00:00Z\n"
    review.write_text(by_whom + HEAD.replace("red.mp4", "b.mp4") + MISSED)
    count = ("count", *paths, "-c", folder / "lines.yaml", "--corrections", review)
    result = run(*count, "--counts", totals, code=0)
    assert "all files" in result.out
    assert result.out.endswith(
        f"{paths[1]}: corrected: 1 event, by b.yaml; minutes checked: 0.03 of 0.03; at checked "
        "lines 1 counted, 2 corrected, 2 estimated (95 %: 2 to 2)\n"
    )
    content = json.loads(totals.read_text())
    rows = {(row["direction"], row["class"]): row for row in content["totals"]}
    numbers = {way: [row[k] for k in ("counted", "count", "checked")] for way, row in rows.items()}
    assert numbers["in", "truck"] == [0, 1, 1.96]
    assert numbers["out", "vehicle"] == [2, 2, 1.96]
    none = dict.fromkeys(("estimated", "low", "high"))  # of the video that nobody checked
    assert content["volumes"][:2] == [
        {"name": "gate", "direction": "out", "counted": 2, "corrected": 2, **none},
        {"name": "gate", "direction": "in", "counted": 0, "corrected": 1, **none},
    ]
    videos = content["videos"]
    assert [video.get("corrected") for video in videos.values()] == [
        None,
        {
            "events": 1, "files": ["b.yaml"], "names": ["gate"], "checked": [[0.0, 1.96]],
            "corrections": [
                {
                    "time": 0.1, "name": "gate", "direction": "in", "class": "truck",
                    "error": ["missed"], "correct": [],
                    "reviewer": "Ann", "saved": "2026-05-01 10:00:00.000+00:00",
                },
            ],
            "estimates": [
                {"name": name, "direction": direction, "class": kind, "counted": counted,
                 "corrected": true, "estimated": true, "low": true, "high": true, "more": 0}
                for name, direction, kind, counted, true in (
                    (None, None, None, 1, 2),
                    ("gate", "out", None, 1, 1),
                    ("gate", "in", None, 0, 1),
                    (None, None, "truck", 0, 1),
                    (None, None, "vehicle", 1, 1),
                )
            ],
        },
    ]  # fmt: skip
    review.write_text(HEAD + MISSED)
    result = run(*count, code=1)
    fault = "corrects red.mp4, which must be exactly one of these videos: a.mp4, b.mp4"
    assert f"{review}: {fault}" in result.err


def test_a_run_corrects_its_counts_records_and_page(
    run: Run, folder: Path, red: tuple[str, ...]
) -> None:
    clip, review = folder / "red.mp4", folder / "c.yaml"
    detect = ("detect-video", clip, "--no-video", *red, "-c", folder / "lines.yaml")
    run(*detect, "--counts", folder / "plain.csv", code=0)
    [event] = [row for row in rows_of(folder / "plain.csv") if row["name"] == "gate"]
    counted = {"line": "gate", "class": "vehicle", "error": "class", "correct": "bus"}
    counted |= {key: event[key] for key in ("time", "direction", "id")}
    review.write_text(f"{HEAD}{MISSED}  - {json.dumps(counted)}\n")
    outputs = {"counts": "c.csv", "flows": "f.json", "vehicles": "v.json", "page": "page"}
    options = [part for name, path in outputs.items() for part in (f"--{name}", folder / path)]
    result = run(*detect, *options, "--corrections", review, code=0)
    assert f"{clip}: corrected: 4 events, by c.yaml" in result.err
    rows = rows_of(folder / "c.csv")
    assert [(row["name"], row["class"]) for row in rows] == [
        ("gate", "truck"), ("gate", "bus"), ("yard", "bus"), ("yard", "bus"),
    ]  # fmt: skip
    flows = json.loads((folder / "f.json").read_text())
    assert flows["corrected"]["files"] == ["c.yaml"]
    assert {row["class"] for row in flows["flows"] if row["count"]} == {"truck", "bus"}
    [record] = json.loads((folder / "v.json").read_text())
    assert (record["class"], record["corrected"]) == ("bus", ["c.yaml"])
    page = (folder / "page" / "page.html").read_text()
    assert "These counts are corrected: 4 events, by c.yaml; minutes checked: 0.04 of 0.04;" in page
    review.write_text(HEAD.replace("red.mp4", "other.mp4") + MISSED)
    result = run(*detect, "--counts", folder / "d.csv", "--corrections", review, code=1)
    assert "c.yaml: corrects other.mp4" in result.err
    assert not (folder / "d.csv").exists()
    result = run("detect-video", clip, "-d", folder / "d", "--corrections", review, code=2)
    assert "--corrections is for one video, without -d" in result.err


def test_the_page_of_a_corrected_run_saved_unchanged_corrects_again(
    run: Run, folder: Path, red: tuple[str, ...]
) -> None:
    """A correction that fits nothing is left out, and named; no output is lost."""
    clip, review, tracks = (folder / name for name in ("red.mp4", "c.yaml", "t.jsonl"))
    review.write_text(f"{HEAD}{MISSED}")
    detect = ("detect-video", clip, "--no-video", *red, "-c", folder / "lines.yaml")
    outputs = ("--tracks", tracks, "--review", folder / "review", "--corrections", review)
    run(*detect, *outputs, "--counts", folder / "first.csv", code=0)
    first = [(row["name"], row["direction"], row["class"]) for row in rows_of(folder / "first.csv")]
    assert ("gate", "in", "truck") in first
    with browser(folder) as window:
        window.open(folder / "review" / "review.html")
        window.type("s")
        saved = downloaded(folder, "corrections.yaml")
    count = ("count", tracks, "-c", folder / "lines.yaml", "--counts", folder / "again.csv")
    run(*count, "--corrections", saved, code=0)
    again = [(row["name"], row["direction"], row["class"]) for row in rows_of(folder / "again.csv")]
    assert again == first
    review.write_text(f"{HEAD}{MISSED}{WRONG.replace('0.52', '1.9')}")
    late = ("--corrections", review, "--counts", folder / "late.csv", "--strict")
    result = run(*detect, *late, code=4)
    assert f"{review}: gate, 1.9 s, out, vehicle: no such event was counted" in result.err
    assert [(r["name"], r["class"]) for r in rows_of(folder / "late.csv")] == [
        (name, kind) for name, _, kind in first
    ]

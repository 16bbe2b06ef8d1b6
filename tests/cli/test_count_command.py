"""`vdet count`, and `--counts` and `--flows` of `vdet detect-video`."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import openpyxl
import pytest

from clips import remuxed
from conftest import Run
from running import names, rows_of, write_drive
from vdet.labels.reading import read_tracks
from vdet.media.images import encode_image
from vdet.run.loop import Pipeline
from vdet.traffic import clock

LINES = """
camera: {size: [320, 240]}
traffic:
  lines:
    - {name: gate, start: [100, 0], end: [100, 240], left: out, right: in}
  zones:
    - {name: yard, points: [[110, 0], [320, 0], [320, 240], [110, 240]]}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a clip of the red car, and lines."""
    folder = tmp_path_factory.mktemp("red")
    write_drive(folder / "red.mp4", 60)
    (folder / "lines.yaml").write_text(LINES)
    return folder


def events_of(path: Path) -> list[tuple[str, ...]]:
    keys = ("clock", "frame", "name", "direction", "id", "score", "vehicle")
    return [tuple(row[key] for key in keys) for row in rows_of(path)]


@pytest.mark.parametrize("form", ["csv", "jsonl", "txt"])
def test_counting_a_file_of_tracks_gives_what_the_run_gave(
    run: Run, folder: Path, tmp_path: Path, red: tuple[str, ...], form: str
) -> None:
    tracks, live, again = tmp_path / f"t.{form}", tmp_path / "live.csv", tmp_path / "again.csv"
    lines, begin = ("-c", folder / "lines.yaml"), ("--begin", "2026-05-01 07:00Z")
    wanted = ("--no-video", "--tracks", tracks, "--counts", live, *lines, *begin)
    run("detect-video", folder / "red.mp4", *red, *wanted, code=0)
    unknown = ("--rate", "25", *begin) if form == "txt" else ()
    result = run("count", tracks, *lines, "--counts", again, *unknown, code=0)
    known = "from the file" if form == "csv" else "as given"
    assert result.err == f"{tracks}: begins 2026-05-01 07:00:00+00:00 ({known})\n"
    assert events_of(again) == events_of(live) != []
    if form != "txt":
        result = run("count", tracks, *lines, "--rate", "25")
        assert "rate: changes nothing, because the tracks have times; remove it" in result.err


def test_regions_hold_for_saved_tracks_and_settings_of_the_search_are_refused(
    run: Run, folder: Path, tmp_path: Path, red: tuple[str, ...]
) -> None:
    tracks, far = tmp_path / "t.jsonl", tmp_path / "far.yaml"
    clip, lines = folder / "red.mp4", ("-c", folder / "lines.yaml")
    run("detect-video", clip, "--no-video", "--tracks", tracks, *red, code=0)
    shapes = "[{name: right, points: [[0.4, 0], [1, 0], [1, 1], [0.4, 1]]}]"
    far.write_text(f"regions: {shapes}\ndetector: {{min_score: 0.5}}\n")
    for number, chosen in enumerate([("--set", f"regions={shapes}"), ("-c", far), ()]):
        live, again = tmp_path / f"live{number}.csv", tmp_path / f"again{number}.csv"
        wanted = ("--no-video", "--counts", live, *red, *lines)
        run("detect-video", clip, *wanted, *chosen[: 2 * (number != 1)], code=0)
        run("count", tracks, *lines, *chosen, "--counts", again, code=0)
        if number != 1:
            assert events_of(again) == events_of(live)
    once, by_file, every = (events_of(tmp_path / f"again{number}.csv") for number in range(3))
    assert once == by_file
    assert ("gate" in {event[2] for event in once}, len(every)) == (False, 3)
    for change in ("detector.min_score=0.5", "tracker={kind: rules}"):
        result = run("count", tracks, *lines, "--set", change, code=2)
        assert f"--set {change}: changes nothing in saved tracks; remove it" in result.err


def test_people_in_tracks_of_another_tool_are_counted_only_if_chosen(
    run: Run, folder: Path, tmp_path: Path
) -> None:
    tracks, lines = tmp_path / "t.csv", ("-c", folder / "lines.yaml")
    rows = [f"{n},{n / 25},1,{4 * n},100,40,40,Pedestrian\n" for n in range(50)]
    tracks.write_text("frame,time,id,x,y,width,height,class\n" + "".join(rows))
    for chosen, count in ((), 0), (("--class", "person"), 1):
        counts = tmp_path / f"{count}.csv"
        result = run("count", tracks, *lines, *chosen, "--counts", counts, code=0)
        assert len([row for row in rows_of(counts) if row["name"] == "gate"]) == count
        assert ("people are not counted; to count them, use --class" in result.err) == (not count)
    review = tmp_path / "fixes.yaml"
    review.write_text("video: t.mp4\nsize: [320, 240]\n")
    result = run("count", tracks, *lines, "--class", "person", "--corrections", review, code=0)
    assert result.out.splitlines()[1].split()[1:] == ["gate", "out", "1", "1", "-", "1", "person"]


@pytest.mark.parametrize("form", ["jsonl", "coco.json"])
def test_tracks_of_a_video_whose_name_is_not_utf8_can_be_counted(
    run: Run, folder: Path, tmp_path: Path, red: tuple[str, ...], form: str
) -> None:
    clip, fixes = tmp_path / "caf\udce9.mp4", tmp_path / "fixes.yaml"
    tracks = tmp_path / f"t.{form}"
    clip.write_bytes((folder / "red.mp4").read_bytes())
    lines = ("-c", folder / "lines.yaml")
    run("detect-video", clip, "--no-video", "--tracks", tracks, *red, code=0)
    video = read_tracks(tracks).video
    assert video
    assert video.name.endswith(r"/caf\udce9.mp4")
    fixes.write_text("{video: 'caf\\udce9.mp4', size: [320, 240]}")
    run("count", tracks, "--corrections", fixes, *lines, code=0)
    wanted = ("--no-video", "--counts", tmp_path / "c.json", "--corrections", fixes)
    run("detect-video", clip, *wanted, *red, *lines, code=0)


NOTHING = (
    "vdet: note: {}: no vehicle crossed a line; if there was traffic, move the line "
    "[nothing-found]\n"
)


def test_doubts_and_the_size_of_the_frames_are_those_of_the_tracks(
    run: Run, folder: Path, tmp_path: Path
) -> None:
    size = {"name": "in.mp4", "width": 320, "height": 240}
    finding = {"code": "camera-moves", "severity": "warning", "text": "the camera moves"}
    record = {"video": size, "frame": 0, "time": 0, "tracks": [], "findings": [finding]}
    tracks = tmp_path / "t.jsonl"
    tracks.write_text(json.dumps(record))
    result = run("count", tracks, "-c", folder / "lines.yaml")
    doubt = f"vdet: warning: {tracks}: the camera moves [camera-moves]\n"
    assert (result.code, result.err) == (0, doubt + NOTHING.format(tracks))
    assert run("count", tracks, "-c", folder / "lines.yaml", "--strict").code == 4
    result = run("count", tracks, "-c", folder / "lines.yaml", "--size", "640x480", code=1)
    assert result.err.endswith(f"{tracks}: is of 320×240 frames, not 640×480\n")
    tracks.write_text(json.dumps(record | {"video": size | {"width": 800}}))
    result = run("count", tracks, "-c", folder / "lines.yaml", code=1)
    assert "for frames of 320×240, whose aspect ratio differs from 800×240" in result.err


def test_flows_have_clock_times_live_and_from_tracks(
    run: Run, folder: Path, tmp_path: Path, red: tuple[str, ...]
) -> None:
    clip, tracks = tmp_path / "v_20260501_065959.mp4", tmp_path / "t.jsonl"  # it keeps the clock
    clip.write_bytes((folder / "red.mp4").read_bytes())
    found = []
    for command in (
        ("detect-video", clip, *red, "--no-video", "--tracks", tracks),
        ("count", tracks),
    ):
        flows = tmp_path / f"{command[0]}.csv", tmp_path / f"{command[0]}.json"
        asked = [word for path in flows for word in ("--flows", path)]
        lines = ("-c", folder / "lines.yaml", "--interval", "5min")
        result = run(*command, *asked, *lines, code=0)
        assert re.search(r"begins 2026-05-01 06:59:59.* \(from its name\)", result.err)
        found.append([path.read_text() for path in flows])
    assert found[0] == found[1]
    rows = list(csv.DictReader(found[0][0].splitlines()))
    assert [(row["start"][:16], row["from"], row["to"], row["count"]) for row in rows] == [
        ("2026-05-01 06:55", "gate", "yard", "0"), ("2026-05-01 07:00", "gate", "yard", "1"),
    ]  # fmt: skip
    assert "from  to gate  to yard  to none" in result.out


def test_times_count_from_the_first_frame_in_any_container(
    run: Run, folder: Path, tmp_path: Path, red: tuple[str, ...]
) -> None:
    keep = {"mpegts_copyts": "1"}
    late = remuxed(tmp_path / "red.ts", folder / "red.mp4", shift=3600 * 12_800, muxing=keep)
    part = ("--begin", "2026-05-01 07:00+00:00", "--start", "0.2", "--at", "1")
    lines = ("-c", folder / "lines.yaml", *part[:2])
    found = []
    for video in (folder / "red.mp4", late):
        out = tmp_path / video.suffix[1:]
        out.mkdir()
        outputs = [
            item
            for sink, name in (
                *(("tracks", "t.csv"), ("counts", "c.csv"), ("vehicles", "v.csv")),
                *(("crops", "crops"), ("clips", "clips"), ("stages", "stages")),
            )
            for item in (f"--{sink}", out / name)
        ]
        run("detect-video", video, *red, "--no-video", *lines, *part[2:], *outputs, code=0)
        run("count", out / "t.csv", *lines, "--counts", out / "again.csv", code=0)
        tables = {path.name: path.read_text() for path in out.glob("*.csv")}
        assert tables["again.csv"] == tables["c.csv"]
        found.append((tables, [Path(name).with_suffix("") for name in names(out)]))
    assert found[0] == found[1]
    assert "2026-05-01 07:00:0" in found[0][0]["c.csv"]


def test_too_many_intervals_are_refused_before_the_video_is_searched(
    run: Run, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clock, "_MAX_COUNT", 1)
    monkeypatch.setattr(Pipeline, "complete", lambda *_: pytest.fail("frames are searched"))
    wanted = ("--no-video", "--page", tmp_path / "page", "--interval", "1s")
    result = run("detect-video", folder / "red.mp4", *wanted, code=1)
    assert "traffic.interval: 1 s makes more than 1 intervals; use a longer one" in result.err


def write_tracks(path: Path, *, shift: int = 0) -> Path:
    """Write the tracks of a car that goes to the right, 4 pixels a frame."""
    rows = [f"{n},{n / 25:.6f},1,{shift + 4 * n},100,40,40,0.9,detected" for n in range(50)]
    path.write_text("\n".join(["frame,time,id,x,y,width,height,score,state", *rows]) + "\n")
    return path


def test_a_workbook_and_a_page_show_all_files_on_a_picture(
    run: Run, folder: Path, tmp_path: Path
) -> None:
    scene = tmp_path / "scene.png"
    scene.write_bytes(encode_image(np.full((240, 320, 3), 99, np.uint8), scene))
    settings = tmp_path / "site.yaml"
    settings.write_text("survey: {site: '<b>Elm Street', picture: scene.png}\n")
    tracks = [write_tracks(tmp_path / f"cam_20260501_07{n}000.csv") for n in range(2)]
    book, page = tmp_path / "day.xlsx", tmp_path / "day"
    lines = ("-c", folder / "lines.yaml", "-c", settings, "--interval", "5min")
    run("count", *tracks, *lines, "--counts", book, "--page", page, code=0)
    sheets = openpyxl.load_workbook(book)
    names = "Summary Intervals Flows Zones Vehicles Files Notes"
    assert (sheets.sheetnames, len(sheets["Summary"]._images)) == (names.split(), 1)
    text = (page / "page.html").read_text()
    assert text.count("data:image/jpeg") == 1
    assert "<title>&lt;b&gt;Elm Street</title>" in text
    assert "gap of 598 s" in text
    scene.write_bytes(encode_image(np.zeros((240, 240, 3), np.uint8), scene))
    result = run("count", *tracks, *lines, "--flows", tmp_path / "f.xlsx", code=1)
    assert "scene.png: camera.size: points are for frames of 320×240, whose aspect" in result.err
    scene.unlink()
    result = run("count", *tracks, *lines, "--flows", tmp_path / "f.xlsx", code=1)
    assert "scene.png: cannot be read: No such file" in result.err


def test_the_workbook_of_a_run_has_a_frame(
    run: Run, folder: Path, tmp_path: Path, red: tuple[str, ...]
) -> None:
    book = tmp_path / "red.xlsx"
    detect = ("detect-video", folder / "red.mp4", *red, "--no-video", "-c", folder / "lines.yaml")
    run(*detect, "--flows", book, code=0)
    sheets = openpyxl.load_workbook(book)
    (picture,) = sheets["Summary"]._images
    assert (picture.width, picture.height) == (320, 240)
    run(*detect, "--flows", tmp_path / "coarse.xlsx", "--set", "output.coarse=true", code=0)
    coarse = openpyxl.load_workbook(tmp_path / "coarse.xlsx")["Summary"]._images[0]
    assert coarse._data() != picture._data(), "without faces and plates"
    assert [cell.value for cell in sheets["Flows"][2]][4:7] == ["gate", "yard", 1]


@pytest.mark.parametrize(
    ("names", "count", "warning"),
    [
        ("", "1", ""),
        ("truck vehicle", "1", ""),
        ("Lorry", "0", NOTHING),
        ("person", "0", NOTHING),
        ("plane", "0", f"{NOTHING}vdet: warning: --class plane: no vehicle of this class was co"),
    ],
)
def test_totals_of_the_chosen_classes_are_printed_whatever_the_detector_finds(
    run: Run, folder: Path, tmp_path: Path, names: str, count: str, warning: str
) -> None:
    tracks = write_tracks(tmp_path / "t.csv")
    chosen = [word for name in names.split() for word in ("--class", name)]
    result = run("count", tracks, "-c", folder / "lines.yaml", *chosen, code=0)
    assert [line.split()[1:4] for line in result.out.splitlines()[:3]] == [
        ["name", "direction", "count"], ["gate", "out", count], ["gate", "in", "0"],
    ]  # fmt: skip
    assert result.err.startswith(warning.format(tracks))
    assert bool(result.err) == bool(warning)
    assert [path.name for path in tmp_path.iterdir()] == ["t.csv"]


def test_lines_in_fractions_are_counted_at_in_frames_of_a_given_size(
    run: Run, tmp_path: Path
) -> None:
    tracks, lines = write_tracks(tmp_path / "t.csv"), tmp_path / "lines.yaml"
    lines.write_text("traffic: {lines: [{name: gate, start: [0.5, 0], end: [0.5, 1]}]}")
    result = run("count", tracks, "-c", lines, "--size", "320x240", code=0)
    assert result.out.split()[6:9] == ["gate", "left", "1"]


def test_the_manifest_of_a_batch_is_skipped(run: Run, tmp_path: Path) -> None:
    tracks, manifest = write_tracks(tmp_path / "t.csv"), tmp_path / "manifest.jsonl"
    (tmp_path / "l.yaml").write_text(LINES)
    manifest.write_text("{}\n")
    result = run("count", manifest, tracks, "-c", tmp_path / "l.yaml")
    assert (result.code, result.err) == (0, "")

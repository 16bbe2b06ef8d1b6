"""`vdet detect-video CLIP... -d DIR`."""

import hashlib
import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest

import vdet
from conftest import Run
from running import frames_of, names, write_drive
from vdet.config.schema import NetworkSettings
from vdet.detect.detectors import model_file


@pytest.fixture
def clips(tmp_path: Path) -> Path:
    folder = tmp_path / "in"
    (folder / "day2").mkdir(parents=True)
    for name, frames in (("a", 12), ("day2/b", 6)):
        write_drive(folder / f"{name}.mp4", frames)
    return folder


def records_of(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "manifest.jsonl").read_text().splitlines()]


def test_clocks_that_are_doubtful_are_said_once(run: Run, tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    for hour in (7, 8, 9):
        video = tmp_path / f"in/20260501_0{hour}0000.mp4"
        write_drive(video, 6, created="2026-03-01T12:00:00Z")
    outputs = ("--no-video", "--tracks", ".csv", "--jobs", "1")
    lines = run("detect-video", video.parent, "-d", tmp_path / "out", *outputs).err.splitlines()
    (said,) = (line for line in lines if "by its metadata" in line)
    assert said.startswith(f"vdet: warning: {video.parent}/20260501_070000.mp4: begins ")
    assert said.endswith("; input.begin overrides it (and 2 more files)")


def test_a_folder_with_a_bad_file_from_the_first_run_to_the_last(
    run: Run, clips: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    outputs = ("--tracks", ".csv", "--page", ".page")
    arguments = ("detect-video", clips, "-d", out, "--jobs", "2", *outputs)
    (clips / "bad.mp4").write_bytes(b"no video")

    first = run(*arguments)
    assert first.code == 3
    assert re.search(rf"{clips}/a\.mp4: 12 frames, \d tracks?, ", first.err)
    assert f"vdet: {clips}/bad.mp4: cannot be opened, is not a video" in first.err
    assert first.err.count("bad.mp4") == 1, "an error is printed once"
    assert first.err.splitlines()[-1] == f"{out}: 2 files done, 1 failed"
    made = ["a.csv", "a.mp4", "a.page/page.html", "day2/b.csv", "day2/b.mp4"]
    assert names(out) == [*made, "day2/b.page/page.html", "index.html", "manifest.jsonl"]
    error = f"<li><b>bad</b> failed: {clips}/bad.mp4: cannot be opened, is not a video"
    assert error in (out / "index.html").read_text()
    assert (frames_of(out / "a.mp4"), frames_of(out / "day2" / "b.mp4")) == (12, 6)
    model = model_file(NetworkSettings())
    assert model is not None
    for record in records_of(out):
        assert record["program"] == f"vdet {vdet.__version__}"
        assert record["model"] == model.name
        assert record["model_sha256"] == hashlib.sha256(model.read_bytes()).hexdigest()

    refused = run(*arguments)
    assert refused.code == 1
    advice = "use --overwrite to replace it, or --skip-existing to keep it"
    assert refused.err == f"vdet: {out}/a.mp4: already exists; {advice}\n"

    before = (out / "a.mp4").stat().st_mtime_ns
    write_drive(clips / "bad.mp4", 3)
    again = run(*arguments, "--skip-existing", code=0)
    assert "1 file done, 2 skipped, 0 failed" in again.err
    assert (out / "a.mp4").stat().st_mtime_ns == before
    assert [Path(record["input"]).name for record in records_of(out)][-1] == "bad.mp4"

    (out / "index.html").unlink()  # as if the batch had been interrupted before it
    nothing = run(*arguments, "--skip-existing", code=0)
    assert nothing.err == f"{out}: 0 files done, 3 skipped, 0 failed\n"
    assert "failed" not in (out / "index.html").read_text()
    assert len(records_of(out)) == 4


def test_with_strict_a_failed_file_decides_the_exit_code_before_a_doubtful_one(
    run: Run, clips: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vdet.batch.ManifestRecord.is_doubtful", True)
    arguments = ("detect-video", clips / "a.mp4", "--no-video", "--tracks", ".csv", "--strict")
    assert run(*arguments, "-d", tmp_path / "doubtful").code == 4
    again = run(*arguments, "-d", tmp_path / "doubtful", "--skip-existing", code=4)
    assert "0 files done, 1 skipped (1 doubtful), 0 failed" in again.err
    (clips / "bad.mp4").write_bytes(b"no video")
    assert run(*arguments, clips / "bad.mp4", "-d", tmp_path / "failed").code == 3


def test_a_warning_is_printed_once_and_not_with_quiet(
    run: Run, clips: Path, tmp_path: Path
) -> None:
    data = (clips / "a.mp4").read_bytes()
    middle = data.index(b"mdat") + 1000
    (clips / "a.mp4").write_bytes(data[:middle] + bytes(1000) + data[middle + 1000 :])
    damaged = ("--set", "input.max_damaged=1")
    options = ("--no-video", "--tracks", ".csv", "--jobs", "1", *damaged)
    loud = run("detect-video", clips, "-d", tmp_path / "loud", *options)
    name = f"{clips}/a.mp4: "
    assert loud.code == 0
    assert f"vdet: warning: {name}" in loud.err
    assert loud.err.count(name) == 2, "the warning, and the result"
    quiet = run("-q", "detect-video", clips, "-d", tmp_path / "quiet", *options)
    assert (quiet.code, quiet.err) == (0, "")


def test_a_name_that_becomes_too_long_fails_alone(run: Run, clips: Path, tmp_path: Path) -> None:
    (clips / "day2" / "b.mp4").rename(clips / f"{'b' * 251}.mp4")
    arguments = ("detect-video", clips, "-d", tmp_path / "out", "--no-video", "--jobs", "1")
    outputs = ("--vehicles", ".cars.csv", "--page", ".page")
    for more in ((), ("--skip-existing",)):
        result = run(*arguments, *outputs, *more)
        assert result.code == 3
        assert "1 failed" in result.err
        assert "bbb.page" in result.err
        assert "File name too long" in result.err
        assert (tmp_path / "out" / "all.cars.csv").exists()


def test_after_other_settings_or_another_model_videos_are_made_again(
    run: Run, clips: Path, tmp_path: Path
) -> None:
    out, shipped = tmp_path / "out", model_file(NetworkSettings())
    assert shipped is not None
    arguments = ("detect-video", clips, "-d", out, "--no-video", "--tracks", ".csv")
    run(*arguments, code=0)
    again = (*arguments, "--skip-existing")
    for change in (("--set", "tracker.confirm_seconds=0.3"), ("-c", "svm"), ("--frames", "3"), ()):
        assert "2 files done, 0 failed" in run(*again, *change).err
    copy = shutil.copy(shipped, tmp_path / "copy.onnx")
    for same in ((), ("--set", "train.net.steps=9"), ("--model", copy)):
        assert "0 files done, 2 skipped, 0 failed" in run(*again, *same).err

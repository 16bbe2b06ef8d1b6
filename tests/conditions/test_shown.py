"""Findings are shown alike in the terminal, JSON, pages, the manifest and Python."""

import json
from pathlib import Path
from typing import Any

import pytest

from conftest import Run
from red_cars import red_settings
from running import write_drive
from vdet.config.loading import render_settings

TEXT = "lanes: no values in metres without camera.lens, lanes.metres"
NO_LANE = "the lane was found in 0 of 12 frames: check lanes.points in --stages"
FINDINGS: list[dict[str, Any]] = [
    {"code": code, "severity": severity, "text": text, "times": [], "value": None}
    for code, severity, text in (
        ("lane-geometry", "note", TEXT), ("lane", "warning", NO_LANE),
    )
]  # fmt: skip


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_drive(tmp_path_factory.mktemp("drive") / "a.mp4", 12)


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("red")
    (folder / "red.yaml").write_text(render_settings(red_settings(folder)), encoding="utf-8")
    return folder / "red.yaml"


def test_one_video_says_it_in_the_terminal_in_a_file_and_on_the_page(
    run: Run, clip: Path, config: Path, tmp_path: Path
) -> None:
    command = ("detect-video", clip, "--no-video", "--lanes", "--strict", "-c", config)
    outputs = ("--sink", f"conditions={tmp_path / 'a.json'}", "--page", tmp_path / "a.page")
    found = run(*command, *outputs, code=4)
    assert f"a.mp4: {NO_LANE} [lane]\n" in found.err
    assert found.err.count(TEXT) == found.err.count(f"note: {TEXT}\n") == 1
    assert json.loads((tmp_path / "a.json").read_text()) == FINDINGS
    assert TEXT in (tmp_path / "a.page" / "page.html").read_text()
    ignore = "--overwrite", "--set", "conditions.ignore=[lane, lane-geometry]"
    assert TEXT not in run(*command, *outputs, *ignore, code=0).err
    assert json.loads((tmp_path / "a.json").read_text()) == []


def test_a_batch_says_a_note_once_and_has_it_in_the_manifest(
    run: Run, clip: Path, config: Path, tmp_path: Path
) -> None:
    (tmp_path / "b.mp4").write_bytes(clip.read_bytes())
    command = ("detect-video", clip, tmp_path / "b.mp4", "-d", tmp_path / "found", "--no-video")
    found = run(*command, "--page", ".page", "--lanes", "-c", config, "--strict", code=4)
    assert found.err.count(TEXT) == found.err.count(f"note: {TEXT}\n") == 1
    lines = (tmp_path / "found" / "manifest.jsonl").read_text().splitlines()
    assert [json.loads(line)["facts"]["conditions"] for line in lines] == [FINDINGS] * 2
    index = (tmp_path / "found" / "index.html").read_text()
    assert (index.count(TEXT), index.count(NO_LANE), index.count("⚠")) == (0, 4, 2)

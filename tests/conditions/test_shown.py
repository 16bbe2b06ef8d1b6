"""Findings are shown alike in the terminal, JSON, pages, the manifest and Python."""

import json
from pathlib import Path
from typing import Any

import pytest

import vdet
from conftest import Run
from red_cars import red_settings
from running import write_drive
from vdet.config.rendering import render_settings

TEXT = "lanes: no values in metres without camera.lens, lanes.metres"
FINDING: dict[str, Any] = {
    "code": "lane-geometry", "severity": "warning", "text": TEXT, "times": [], "value": None,
}  # fmt: skip


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
    found = run(*command, *outputs)
    assert found.code == 4
    assert found.err.count(f"vdet: warning: {clip}: {TEXT} [lane-geometry]\n") == 1
    assert json.loads((tmp_path / "a.json").read_text()) == [FINDING]
    assert TEXT in (tmp_path / "a.page" / "page.html").read_text()
    ignoring = run(*command, *outputs, "--overwrite", "--set", "conditions.ignore=[lane-geometry]")
    assert (ignoring.code, "warning" in ignoring.err) == (0, False)
    assert json.loads((tmp_path / "a.json").read_text()) == []


def test_a_batch_says_it_in_the_manifest_and_in_the_index(
    run: Run, clip: Path, config: Path, tmp_path: Path
) -> None:
    command = ("detect-video", clip, "-d", tmp_path / "found", "--jobs", "1", "--no-video")
    found = run(*command, "--page", ".page", "--lanes", "-c", config, "--strict")
    assert found.code == 4
    assert TEXT in found.err
    (record,) = map(json.loads, (tmp_path / "found" / "manifest.jsonl").read_text().splitlines())
    assert record["facts"]["conditions"] == [FINDING]
    index = (tmp_path / "found" / "index.html").read_text()
    assert f"<td>{TEXT}</td>" in index
    assert f'<span title="{TEXT}"> ⚠</span>' in index


def test_python_gets_it_too(clip: Path, config: Path, tmp_path: Path) -> None:
    settings = vdet.load_settings(config, ["lanes.enabled=true"])
    totals = vdet.detect_video(clip, tracks=tmp_path / "a.csv", settings=settings)
    assert totals.facts["conditions"].record() == [FINDING]

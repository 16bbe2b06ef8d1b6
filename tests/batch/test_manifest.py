"""The manifest: whole lines, whatever already exists."""

import json
from pathlib import Path

import pytest

from vdet.batch.task import ManifestRecord, Written, open_manifest, read_batch
from vdet.errors import OutputError

RECORD = ManifestRecord(
    "/in/a.mp4",
    "2026-01-02T03:04:05+00:00",
    seconds=1.5,
    model="net.onnx",
    model_sha256="12ab",
    width=4,
    height=3,
    frames=2,
    tracks=1,
    outputs=(Written("tracks", "/out/a.csv", 70, 123_456, "digest", [1]),),
    program="vdet 1.2",
)


def lines(path: Path) -> list[str]:
    return path.read_text().splitlines()


def test_a_line_that_is_nested_too_deeply_is_skipped(tmp_path: Path) -> None:
    (tmp_path / "manifest.jsonl").write_text("[" * 200_000 + "\n" + RECORD.line)
    assert [record.input for record in read_batch(tmp_path)] == [RECORD.input]


def test_a_record_is_there_as_soon_as_it_is_added(tmp_path: Path) -> None:
    path = tmp_path / "manifest.jsonl"
    with open_manifest(tmp_path) as add:
        add(RECORD)
        (line,) = lines(path)
        add(RECORD)
    output = {"sink": "tracks", "path": "/out/a.csv", "bytes": 70, "changed": 123_456}
    assert json.loads(line) == {
        "input": "/in/a.mp4", "started": "2026-01-02T03:04:05+00:00", "seconds": 1.5,
        "model": "net.onnx", "model_sha256": "12ab", "width": 4, "height": 3, "frames": 2,
        "tracks": 1, "begin": None, "facts": {}, "warnings": [], "error": None,
        "outputs": [output | {"digest": "digest", "summary": [1]}], "program": "vdet 1.2",
    }  # fmt: skip
    assert len(lines(path)) == 2


def test_names_of_any_kind_can_be_recorded(tmp_path: Path) -> None:
    path = tmp_path / "manifest.jsonl"
    odd = ManifestRecord("/in/\udcff \n\U0001f697.mp4", "now", error="\udcff: bad")
    with open_manifest(tmp_path) as add:
        add(odd)
    (line,) = lines(path)
    assert json.loads(line)["input"] == odd.input


def test_a_disk_that_is_full_is_named(tmp_path: Path) -> None:
    (tmp_path / "manifest.jsonl").symlink_to("/dev/full")
    words = r"manifest\.jsonl: cannot be written: No space left on"
    with pytest.raises(OutputError, match=words), open_manifest(tmp_path) as add:
        add(RECORD)


def test_half_a_line_that_a_power_cut_left_does_not_spoil_the_next_one(tmp_path: Path) -> None:
    (tmp_path / "manifest.jsonl").write_text(RECORD.line + RECORD.line[:50], encoding="utf-8")
    with open_manifest(tmp_path) as add:
        add(RECORD)
    assert [record.line for record in read_batch(tmp_path)] == [RECORD.line, RECORD.line]


def test_a_second_batch_into_the_folder_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "manifest.jsonl"

    def open_again() -> None:
        with open_manifest(tmp_path):
            pass

    with open_manifest(tmp_path) as add:
        with pytest.raises(OutputError, match=r"manifest\.jsonl: another batch is writing here"):
            open_again()
        add(RECORD)
    open_again()
    assert len(lines(path)) == 1

"""Tracks of OTVision, in the versions that OTAnalytics knows."""

import bz2
import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from labels.saving import VIDEO, car, frame, read_back, written
from vdet.boxes import Box
from vdet.errors import TruthError
from vdet.labels import parsing
from vdet.labels.formats import TrackWriter
from vdet.labels.ottrk import OTTRK, read_ottrk
from vdet.track.track import FrameTracks

BEGIN = datetime(2026, 5, 1, 5, tzinfo=UTC)
FRAMES = [frame(index, car(1, Box.sized(10 * index, 20, 30, 40))) for index in range(3)]


def document(frames: list[FrameTracks]) -> Any:
    return json.loads(bz2.decompress(written(OTTRK, frames)))


def packed(value: Any) -> bytes:
    return bz2.compress(json.dumps(value).encode())


def test_a_detection_has_all_that_otanalytics_reads() -> None:
    first, *_, last = document(FRAMES)["data"]["detections"]
    assert {key: first[key] for key in ("class", "x", "y", "w", "h", "frame", "occurrence")} == {
        "class": "car", "x": 0, "y": 20, "w": 30, "h": 40, "frame": 1, "occurrence": "0.000000",
    }  # fmt: skip
    assert (first["first"], first["finished"], first["track-id"]) == (True, False, 1)
    assert (last["first"], last["finished"], last["interpolated-detection"]) == (False, True, False)


def test_the_metadata_describe_the_video() -> None:
    metadata = document(FRAMES)["metadata"]
    assert (metadata["otdet_version"], metadata["ottrk_version"]) == ("1.2", "1.1")
    assert metadata["video"] == {
        "filename": "road & rail", "filetype": ".mp4", "width": 1280, "height": 720,
        "recorded_fps": 25, "number_of_frames": 3, "recorded_start_date": "0.000000",
        "length": "0:00:00",
    }  # fmt: skip
    assert metadata["detection"]["model"]["classes"] == {"0": "car"}
    assert {"tracking_run_id", "frame_group"} <= metadata["tracking"].keys()


def test_the_clock_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "t.ottrk"
    with path.open("wb") as file:
        writer = TrackWriter(OTTRK, file, replace(VIDEO, begin=BEGIN))
        for frame in FRAMES:
            writer.write(frame)
        writer.end()
    saved = read_ottrk(path, path.read_bytes())
    assert saved.begin == BEGIN
    assert saved.times == pytest.approx({0: 0, 1: 0.04, 2: 0.08})


def test_what_is_no_such_file_is_refused(tmp_path: Path) -> None:
    narrow, old = document(FRAMES), document(FRAMES)
    del narrow["data"]["detections"][1]["w"]
    old["metadata"]["video"]["recorded_start_date"] = "2020-01-01 00:00:00.000000"
    other = r"is not OTVision's tracks with detections of version 1\.2, or is damaged: "
    for data, message in (
        (b"{}", f"{other}Invalid data stream"),
        (written(OTTRK, FRAMES)[:-9], f"{other}Compressed file ended"),
        (packed({"data": {"detections": []}}), r"version 1\.2: has no metadata\.video"),
        (packed({"data": {"detections": [1]}}), f"{other}'int' object has no attribute 'get'"),
        (packed(old), f"{other}recorded_start_date: Input should be a valid number"),
        (packed(narrow), r"data\.detections\.1: width: Input should be a valid number"),
    ):
        with pytest.raises(TruthError, match=message):
            read_back(OTTRK, tmp_path, data)


def test_what_expands_to_more_than_the_limit_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(parsing, "MAX_BYTES", 1000)
    with pytest.raises(TruthError, match=r"is larger than 1,000 bytes; cut it"):
        read_back(OTTRK, tmp_path, bz2.compress(b" " * 1001))

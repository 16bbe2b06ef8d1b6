"""Counting on the project video: a line across the lanes to the right of the camera."""

import csv
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from conftest import Run
from vdet.boxes import Box
from vdet.config.loading import load_settings
from vdet.labels.reading import read_truth
from vdet.track.track import FrameTracks, Track
from vdet.traffic.counter import count_frames

pytestmark = pytest.mark.realdata

LINES = """
size: [1280, 720]
lines:
  - {name: right lanes, start: [760, 520], end: [1280, 520], left: ahead, right: back}
"""
FIRST, END = 31.5, 34.5  # seconds; the black car crosses the line at 33.3


@pytest.fixture
def truth(real_data: Path) -> list[FrameTracks]:
    name = "project_video_0001-0880.txt"
    places = [real_data / name, real_data.parent / "labels" / name]
    path = next((place for place in places if place.exists()), None)
    if path is None:
        pytest.skip("the truth of the video is not here; data/README.md tells what it is")
    return list(true_tracks(path))


def true_tracks(path: Path) -> Iterator[FrameTracks]:
    """Give the vehicles that must be found, frame by frame."""
    video = read_truth(path)
    video = video.where(~video.ignored)
    for number in sorted(set(video.frames.tolist())):
        rows = video.frame(number)
        boxes = [Box(*box).rounded for box in rows.boxes.tolist()]
        tracks = [
            Track(n, box, 1.0, False) for n, box in zip(rows.ids.tolist(), boxes, strict=True)
        ]
        yield FrameTracks(number - 1, (number - 1) / 25, tuple(tracks))


def test_a_line_across_the_right_hand_lanes(
    run: Run, real_data: Path, truth: list[FrameTracks], tmp_path: Path
) -> None:
    lines = tmp_path / "lines.yaml"
    lines.write_text(LINES)
    settings = load_settings(None, (), {"counts": lines}).counts
    expected = count_frames(truth, settings).events
    assert Counter(event.direction for event in expected) == {"ahead": 2}
    shown = (frame for frame in truth if FIRST <= frame.time < END)
    later = count_frames(shown, settings).events
    counts = tmp_path / "counts.csv"
    result = run(
        "detect-video", real_data / "project_video.mp4", "--no-video", "--lines", lines,
        "--counts", counts, "--start", str(FIRST), "--end", str(END),
    )  # fmt: skip
    assert result.code == 0, result.err
    with counts.open() as file:
        rows = list(csv.DictReader(file))
    assert [row["direction"] for row in rows] == [event.direction for event in later] == ["ahead"]
    assert float(rows[0]["time"]) == pytest.approx(later[0].time, abs=0.7)

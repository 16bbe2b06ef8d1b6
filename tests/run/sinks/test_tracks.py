"""Files of tracks in each format."""

import io
import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from red_cars import SETTINGS
from run.red_runs import result_of, write
from vdet.boxes import Box
from vdet.config.schema import LaneSettings
from vdet.findings import Finding, Findings
from vdet.labels.reading import read_tracks
from vdet.lanes.road import Lane, RoadFinder
from vdet.media import Picture
from vdet.run.sinks import Output
from vdet.run.steps import FrameResult
from vdet.track.track import Track
from vdet.traffic.clock import Clock

RESULTS = (
    result_of(
        Track(1, Box.sized(10, 20, 30, 40), 0.98765, "detected", "car"),
        index=4,
        time=Fraction(4, 25),
    ),
    result_of(index=5, time=Fraction(1, 3)),
    result_of(
        Track(1, Box.sized(11, 21, 31, 41), 0.5, "predicted", "car", (27.25, 63.504), 18.249, -1),
        Track(2, Box.sized(0, -3, 5, 6), 1.0, state="detected"),
        index=6,
        time=Fraction(6, 25),
    ),
)
BEGIN = datetime(2026, 5, 1, 7, tzinfo=UTC)
HEADING = "frame,time,id,x,y,width,height,score,state,class,foot_x,foot_y,distance,lane,clock\n"
LANE = Lane(
    curvature=-0.001,
    radius=1000.0,
    offset=0.25,
    width=3.7,
    left=np.array([[1.0, 8.0], [3.0, 4.0]]),
    right=np.array([[9.0, 8.0], [7.0, 4.0]]),
)


def written(path: Path, results: Sequence[FrameResult] = RESULTS) -> str:
    write(Output("tracks", path), results)
    return path.read_bytes().decode()


def test_motchallenge_text_counts_frames_and_pixels_from_1(tmp_path: Path) -> None:
    assert written(tmp_path / "tracks.txt") == (
        "5,1,11,21,30,40,0.9877,-1,-1,-1\n"
        "7,1,12,22,31,41,0.5000,-1,-1,-1\n"
        "7,2,1,-2,5,6,1.0000,-1,-1,-1\n"
    )  # fmt: skip


def test_csv_has_a_heading_and_counts_from_0(tmp_path: Path) -> None:
    assert written(tmp_path / "tracks.csv") == (
        f"{HEADING}"
        "4,0.160000,1,10,20,30,40,0.9877,detected,car,25.0,60.0,,,\n"
        "6,0.240000,1,11,21,31,41,0.5000,predicted,car,27.25,63.5,18.25,-1,\n"
        "6,0.240000,2,0,-3,5,6,1.0000,detected,,2.5,3.0,,,\n"
    )


def test_json_lines_have_a_record_for_every_frame(tmp_path: Path) -> None:
    video, end, records = written(tmp_path / "tracks.jsonl").partition(', "frame": 4,')
    assert json.loads(f"{video}}}")["video"]["name"] == "red.mp4"
    assert end + records == (
        ', "frame": 4, "time": 0.16, "tracks": [{"id": 1, "x": 10, "y": 20, "width": 30, '
        '"height": 40, "score": 0.9877, "state": "detected", "class": "car", "foot": [25.0, 60.0], '
        '"distance": null, "lane": null}], "last": false}\n'
        '{"frame": 5, "time": 0.333333, "tracks": []}\n'
        '{"frame": 6, "time": 0.24, "tracks": [{"id": 1, "x": 11, "y": 21, "width": 31, '
        '"height": 41, "score": 0.5, "state": "predicted", "class": "car", "foot": [27.25, 63.5], '
        '"distance": 18.25, "lane": -1}, {"id": 2, "x": 0, "y": -3, "width": 5, '
        '"height": 6, "score": 1.0, "state": "detected", "class": null, "foot": [2.5, 3.0], '
        '"distance": null, "lane": null}], "last": true}\n'
    )


def test_standard_output_gets_a_frame_with_the_next_one(monkeypatch: pytest.MonkeyPatch) -> None:
    pipe = io.BytesIO()
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(io.BufferedWriter(pipe)))
    lines: list[int] = []

    def results() -> Iterator[FrameResult]:
        for result in RESULTS:
            yield result
            lines.append(pipe.getvalue().count(b"\n"))

    write(Output("tracks", Path("-")), results())
    assert lines == [0, 1, 2]
    assert pipe.getvalue().count(b"\n") == 3


def test_json_lines_tell_the_lane_where_it_was_looked_for(tmp_path: Path) -> None:
    finder = RoadFinder(None, LaneSettings(), 64, 36)
    road = finder.update(finder.observe(Picture(np.zeros((36, 64, 3), np.uint8))))
    found = [
        replace(result, facts={"lane": replace(road, lane=lane)})
        for result, lane in zip(RESULTS, (LANE, None, None), strict=True)
    ]
    with_lanes = written(tmp_path / "with.jsonl", found).splitlines()
    without = written(tmp_path / "without.jsonl").splitlines()
    lanes = []
    for line, other in zip(with_lanes, without, strict=True):
        record = json.loads(line)
        lanes.append(record.pop("lane"))
        assert record == json.loads(other)
    assert lanes == [LANE.record(), None, None]


@pytest.mark.parametrize("ending", [".jsonl", ".coco.json"])
def test_tracks_know_their_video_its_clock_and_why_they_may_be_wrong(
    tmp_path: Path, ending: str
) -> None:
    findings = Findings(
        (
            Finding("camera-moves", "the camera moves", ((0.0, 2.0),), value=0.1),
            Finding("lane-geometry", "no values in metres", severity="note"),
            Finding("line", "gate: no vehicle crossed this line"),
        ),
        facts=(Finding("camera-moved", "the camera moved", severity="fact"),),
    )
    path, clock = tmp_path / f"tracks{ending}", Clock(BEGIN, "its creation time")
    settings = SETTINGS.model_copy(update={"classes": ("car",)})
    write(Output("tracks", path), RESULTS[:2], settings=settings, clock=clock, findings=findings)
    saved = read_tracks(path)
    assert saved.video is not None
    assert (saved.video.name, saved.size, saved.video.rate) == ("red.mp4", (320, 240), 25)
    assert (saved.begin, saved.begin_source) == (BEGIN, "its creation time")
    assert saved.video.classes == ("car",)
    assert saved.video.settings["tracker"]["kind"] == SETTINGS.tracker.kind
    assert saved.findings == (*findings.items[:2], *findings.facts)

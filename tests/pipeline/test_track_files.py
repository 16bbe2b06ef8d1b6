import json
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from vdet.config.lanes import LaneSettings
from vdet.errors import OutputError
from vdet.evaluate.predictions import read_predictions
from vdet.geometry import Box
from vdet.lanes.lane import Lane, lane_record
from vdet.lanes.road import LaneRequest, Road, RoadFinder
from vdet.media.frame import Frame
from vdet.pipeline.sinks.tracks import check_suffix, track_writer
from vdet.track.track import Track

IMAGE = np.zeros((2, 2, 3), np.uint8)
FRAMES: list[tuple[int, Fraction, list[Track]]] = [
    (4, Fraction(4, 25), [Track(1, Box(10, 20, 30, 40), predicted=False)]),
    (5, Fraction(1, 3), []),
    (
        6,
        Fraction(6, 25),
        [Track(1, Box(11, 21, 31, 41), predicted=True), Track(2, Box(0, -3, 5, 6), False)],
    ),
]


LANE = Lane(
    curvature=-0.001,
    radius=1000.0,
    offset=0.25,
    width=3.7,
    left=np.array([[1.0, 8.0], [3.0, 4.0]]),
    right=np.array([[9.0, 8.0], [7.0, 4.0]]),
)


def write(path: Path, frames: Sequence[tuple[int, Fraction, list[Track]]] = FRAMES) -> str:
    with track_writer(path) as writer:
        for index, time, tracks in frames:
            writer.write(Frame(index, time, IMAGE), tracks)
    return path.read_bytes().decode()


def test_motchallenge_text_counts_frames_and_pixels_from_1(tmp_path: Path) -> None:
    assert write(tmp_path / "tracks.txt") == (
        "5,1,11,21,30,40,1,-1,-1,-1\n"
        "7,1,12,22,31,41,1,-1,-1,-1\n"
        "7,2,1,-2,5,6,1,-1,-1,-1\n"
    )  # fmt: skip


def test_csv_has_a_heading_and_counts_from_0(tmp_path: Path) -> None:
    assert write(tmp_path / "tracks.csv") == (
        "frame,time,id,x,y,width,height,predicted\n"
        "4,0.160000,1,10,20,30,40,0\n"
        "6,0.240000,1,11,21,31,41,1\n"
        "6,0.240000,2,0,-3,5,6,0\n"
    )


def test_json_lines_have_a_record_for_every_frame(tmp_path: Path) -> None:
    assert write(tmp_path / "tracks.jsonl") == (
        '{"frame": 4, "time": 0.16, "tracks": [{"id": 1, "x": 10, "y": 20, "width": 30, '
        '"height": 40, "predicted": false}]}\n'
        '{"frame": 5, "time": 0.333333, "tracks": []}\n'
        '{"frame": 6, "time": 0.24, "tracks": [{"id": 1, "x": 11, "y": 21, "width": 31, '
        '"height": 41, "predicted": true}, {"id": 2, "x": 0, "y": -3, "width": 5, '
        '"height": 6, "predicted": false}]}\n'
    )


def road(lane: Lane | None) -> Road:
    image = np.zeros((36, 64, 3), np.uint8)
    finder = RoadFinder(LaneRequest(), LaneSettings(), 64, 36)
    return replace(finder.update(finder.observe(image)), lane=lane)


def write_with_lanes(path: Path) -> str:
    with track_writer(path) as writer:
        for (index, time, tracks), lane in zip(FRAMES, (LANE, None, None), strict=True):
            writer.write(Frame(index, time, IMAGE), tracks, road(lane))
    return path.read_bytes().decode()


def test_json_lines_tell_the_lane_where_it_was_looked_for(tmp_path: Path) -> None:
    with_lanes = write_with_lanes(tmp_path / "with.jsonl").splitlines()
    without = write(tmp_path / "without.jsonl").splitlines()
    lanes = []
    for line, other in zip(with_lanes, without, strict=True):
        record = json.loads(line)
        lanes.append(record.pop("lane"))
        assert record == json.loads(other)
    assert lanes == [lane_record(LANE), None, None]


@pytest.mark.parametrize("suffix", [".txt", ".csv"])
def test_other_formats_have_no_place_for_a_lane(tmp_path: Path, suffix: str) -> None:
    assert write_with_lanes(tmp_path / f"a{suffix}") == write(tmp_path / f"b{suffix}")


def test_without_frames_only_a_heading_is_written(tmp_path: Path) -> None:
    heading = "frame,time,id,x,y,width,height,predicted\n"
    texts = [write(tmp_path / f"tracks{suffix}", []) for suffix in (".txt", ".csv", ".jsonl")]
    assert texts == ["", heading, ""]


def test_the_case_of_the_suffix_does_not_matter(tmp_path: Path) -> None:
    assert write(tmp_path / "A.CSV") == write(tmp_path / "b.csv")


@pytest.mark.parametrize("name", ["tracks.json", "tracks", "tracks.xml"])
def test_an_unknown_suffix_names_those_that_are_known(tmp_path: Path, name: str) -> None:
    with pytest.raises(OutputError, match=r"tracks are written as \.txt, \.csv, \.jsonl"):
        check_suffix(tmp_path / name)
    with pytest.raises(OutputError, match="tracks are written as"), track_writer(tmp_path / name):
        pass
    assert list(tmp_path.iterdir()) == []


def test_tracks_without_a_file_go_nowhere() -> None:
    with track_writer(None) as writer:
        writer.write(Frame(0, Fraction(0), IMAGE), FRAMES[0][2])


@pytest.mark.parametrize("suffix", [".txt", ".csv", ".jsonl"])
def test_an_error_leaves_no_half_written_tracks(tmp_path: Path, suffix: str) -> None:
    def interrupted() -> None:
        with track_writer(tmp_path / f"tracks{suffix}") as writer:
            writer.write(Frame(0, Fraction(0), IMAGE), FRAMES[0][2])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".txt", ".csv", ".jsonl"])
def test_written_tracks_are_read_back_by_the_evaluation(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"tracks{suffix}"
    write(path)
    video = read_predictions(path)
    assert video.frames.tolist() == [5, 7, 7]
    assert video.ids.tolist() == [1, 1, 2]
    assert video.boxes.tolist() == [[10, 20, 30, 40], [11, 21, 31, 41], [0, -3, 5, 6]]

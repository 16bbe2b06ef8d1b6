"""Files of tracks that follow one another: a vehicle on both sides of a seam counts once."""

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path as File

import pytest

from traffic.scenes import Path, frames, settings_for, through
from vdet.config.schema import InputSettings
from vdet.config.shapes import LineSettings, ZoneSettings
from vdet.labels.formats import TrackWriter
from vdet.labels.native import JSON_LINES
from vdet.traffic.counting import count_files
from vdet.traffic.counts import Counts, flow_table, zone_table

SETTINGS = settings_for(
    LineSettings(name="west", start=(200, 200), end=(200, 600), left="out", right="in"),
    LineSettings(name="east", start=(1000, 200), end=(1000, 600), left="out", right="in"),
    ZoneSettings(name="stop", points=((500, 500), (700, 500), (700, 700), (500, 700))),
)
GOES_EAST = through((0, 100, 400), (20, 1100, 400))  # at 600 at the seam
ON_THE_LINE = through((0, 100, 300), (10, 199, 300), (20, 300, 300))
STANDS = through((2, 540, 600), (4, 600, 600), (18, 601, 600))


def write_halves(folder: File, names: Sequence[str], *paths: Path) -> list[File]:
    """Write the tracks of 20 s into two files, each with ids and times of its own."""
    files = []
    halves = groupby(frames(*paths, seconds=19.96), lambda frame: frame.time >= 10)
    for name, (_, half) in zip(names, halves, strict=True):
        path = folder / name
        with path.open("wb") as file:
            writer = TrackWriter(JSON_LINES, file)
            for index, frame in enumerate(half):
                writer.write(type(frame)(index, index / 25, frame.tracks))
        files.append(path)
    return files


def count(files: Sequence[File]) -> list[Counts]:
    return list(count_files(files, SETTINGS).values())


FOLLOWING = ["v_20260501_070000.jsonl", "v_20260501_070010.jsonl"]


def test_a_vehicle_at_the_seam_is_one_flow(tmp_path: File) -> None:
    videos = count(write_halves(tmp_path, FOLLOWING, GOES_EAST))
    (row,) = flow_table(videos)
    assert (row.origin, row.destination, row.count) == ("west", "east", 1)
    assert [len(video.events) for video in videos] == [1, 1]
    assert videos[1].events[0].time == pytest.approx(8, abs=0.05), "in the time of its own file"


def test_a_vehicle_on_the_line_at_the_seam_counts_once(tmp_path: File) -> None:
    first, second = count(write_halves(tmp_path, FOLLOWING, ON_THE_LINE))
    assert [event.name for event in (*first.events, *second.events)] == ["west"]


def test_a_stay_goes_on_beyond_the_seam(tmp_path: File) -> None:
    (row,) = zone_table(count(write_halves(tmp_path, FOLLOWING, STANDS)))
    assert (row.entered, row.left, row.max) == (1, 1, 1)
    assert row.max_stay == pytest.approx(16, abs=0.05)


@pytest.mark.parametrize("begin", ["070009", "070011"])
def test_clocks_have_whole_seconds(tmp_path: File, begin: str) -> None:
    names = [FOLLOWING[0], f"v_20260501_{begin}.jsonl"]
    (row,) = flow_table(count(write_halves(tmp_path, names, GOES_EAST)))
    assert row.count == 1


OTHERS = ["b.jsonl", "v_20260501_070000_2.jsonl", "v_20260501_080000.jsonl"]


@pytest.mark.parametrize("second", OTHERS)
def test_files_that_do_not_follow_have_vehicles_of_their_own(tmp_path: File, second: str) -> None:
    videos = count(write_halves(tmp_path, [FOLLOWING[0], second], GOES_EAST))
    assert [(row.origin, row.destination) for row in flow_table(videos)] == [
        ("west", None), ("east", None),
    ]  # fmt: skip
    numbers = [{event.vehicle for event in video.events} for video in videos]
    assert not numbers[0] & numbers[1]


def test_the_same_id_in_the_next_file_elsewhere_is_another_vehicle(tmp_path: File) -> None:
    jumps = through((0, 100, 400), (9.96, 600, 400), (10, 600, 250), (20, 1100, 250))
    rows = flow_table(count(write_halves(tmp_path, FOLLOWING, jumps)))
    assert [(row.origin, row.destination) for row in rows] == [("west", None), ("east", None)]


@pytest.mark.parametrize("names", [("a.jsonl", "b.jsonl"), FOLLOWING])
def test_a_begin_is_that_of_the_first_of_several_files(
    tmp_path: File, names: Sequence[str]
) -> None:
    settings = SETTINGS.model_copy(update={"input": InputSettings(begin="2026-01-02 03:04Z")})
    files = write_halves(tmp_path, names, GOES_EAST)
    clocks = [str(counts.clock) for counts in count_files(files, settings).values()]
    assert clocks == [f"2026-01-02 03:04:{second}+00:00 (as given)" for second in ("00", "10")]

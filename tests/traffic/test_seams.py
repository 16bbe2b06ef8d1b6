"""Files of tracks that follow one another: a vehicle on both sides of a seam counts once."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path as File

import pytest

from traffic.scenes import Path, frames, settings_for, through
from vdet.config.schema import InputSettings
from vdet.config.shapes import LineSettings, ZoneSettings
from vdet.labels.formats import TrackWriter
from vdet.labels.label import SourceVideo
from vdet.labels.lines import JSON_LINES
from vdet.track.track import FrameTracks
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


CLOCK = datetime(2026, 5, 1, 7, tzinfo=UTC)


def write_part(path: File, first: float, last: float, *paths: Path, clock: float = -1) -> File:
    """Write a part of the tracks of 60 s into a file whose frames begin at 0.

    `clock` is its start in the file itself, seconds after 7:00; -1: only the name has it.
    """
    path.parent.mkdir(exist_ok=True)
    video = [f for f in frames(*paths, seconds=60) if first - 0.001 <= f.time < last - 0.001]
    with path.open("wb") as file:
        writer = TrackWriter(JSON_LINES, file, SourceVideo("v.mp4", 1280, 720))
        for index, frame in enumerate(video):
            time = index / 25
            begins = (CLOCK + timedelta(seconds=clock + time)).isoformat()
            facts = {"clock": begins} if clock >= 0 else {}
            writer.write(FrameTracks(index, time, frame.tracks, facts))
        writer.end()
    return path


def write_halves(folder: File, names: Sequence[str], *paths: Path) -> list[File]:
    """Write the tracks of 20 s into two files."""
    starts = zip(names, (0, 10), strict=True)
    return [write_part(folder / name, first, first + 10, *paths) for name, first in starts]


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


def test_ends_do_not_add_up_before_a_pause(tmp_path: File) -> None:
    goes, other = through((0, 100, 400), (30, 600, 400)), through((35, 600, 400), (45, 1100, 400))
    files = []
    for second in range(0, 30, 2):  # each half a second longer than its slot
        name = f"v_20260501_0700{second:02}.jsonl"
        files.append(write_part(tmp_path / name, second, second + 2.5, goes))
    files.append(write_part(tmp_path / "v_20260501_070035.jsonl", 35, 45, other))
    rows = flow_table(count(files))
    assert [(r.origin, r.destination) for r in rows] == [("west", None), ("east", None)]


def test_exact_clocks_show_a_short_gap(tmp_path: File) -> None:
    fast = through((0, 100, 400), (5.5, 1200, 400))
    files = [
        write_part(tmp_path / "a_0001.jsonl", 0, 2, fast, clock=0.001),
        write_part(tmp_path / "a_0002.jsonl", 2.52, 6, fast, clock=2.521),
    ]
    (row,) = flow_table(count(files))
    assert (row.origin, row.destination, row.count) == ("west", "east", 1)


@pytest.mark.parametrize(
    ("first", "second", "is_joined"),
    [
        ("20260501_070000_000123NF", "20260501_070010_000124NF", True),
        ("20260501_070000_000123NF", "20260501_070010_000124NR", False),
        ("cam1_20260501_070000", "cam2_20260501_070010", False),
        ("1001_20260501_070000", "1002_20260501_070010", False),
        ("20260501_070000_cam1", "20260501_070010_cam2", False),
        ("20260501_070000", "rear/20260501_070010", False),
        ("2026-05-01/20260501_070000", "2026-05-02/20260501_070010", True),
    ],
)
def test_only_files_of_one_camera_are_joined(
    tmp_path: File, first: str, second: str, is_joined: bool
) -> None:
    files = [
        write_part(tmp_path / f"{first}.jsonl", 0, 10, GOES_EAST),
        write_part(tmp_path / f"{second}.jsonl", 10, 20, GOES_EAST),
    ]
    rows = flow_table(count(files))
    assert [(r.origin, r.destination) for r in rows] == (
        [("west", "east")] if is_joined else [("west", None), ("east", None)]
    )


@pytest.mark.parametrize("repeated", [1, 2, 3, 10, 12])
def test_frames_that_the_next_file_repeats_count_once(
    tmp_path: File, caplog: pytest.LogCaptureFixture, repeated: int
) -> None:
    cars = [through((t, 100, y), (t + 6, 1100, y)) for y, t in ((300, 4), (400, 13), (500, 18.5))]
    files = [
        write_part(tmp_path / "v_20260501_070000.jsonl", 0, 20, *cars),
        write_part(tmp_path / f"v_20260501_0700{20 - repeated:02}.jsonl", 20 - repeated, 40, *cars),
    ]
    videos = count(files)
    (row,) = flow_table(videos)
    assert (row.origin, row.destination, row.count) == ("west", "east", 3)
    assert videos[1].spans == ((repeated, repeated + 19.96),)
    (message,) = caplog.messages
    assert message == (
        f"{files[1]}: begins {repeated}.0 s before the end of {files[0]}; these frames are not "
        "counted again; if its clock is wrong, count it on its own"
    )


def test_the_next_vehicle_in_a_lane_is_not_a_repeat(
    tmp_path: File, caplog: pytest.LogCaptureFixture
) -> None:
    cars = [through((t, 100, 400), (t + 6, 1100, 400)) for t in (12, 20.5)]
    files = [
        write_part(tmp_path / "v_20260501_070000.jsonl", 0, 20, *cars),
        write_part(tmp_path / "v_20260501_070020.jsonl", 20, 40, *cars),
    ]
    (row,) = flow_table(count(files))
    assert (row.count, caplog.messages) == (2, [])


def test_a_file_within_another_counts_nothing(tmp_path: File) -> None:
    names = ["GX010001.jsonl", "GX020001.jsonl", "GX030001.jsonl"]
    parts = [(0, 20, 0), (0, 10, 0), (20, 30, 20)]
    files = [
        write_part(tmp_path / name, first, last, GOES_EAST, clock=clock)
        for name, (first, last, clock) in zip(names, parts, strict=True)
    ]
    assert [len(video.events) for video in count(files)] == [2, 0, 0]


@pytest.mark.parametrize("crossed_at", [9.9602, 9.98, 9.9999])
def test_an_event_just_after_a_seam_has_frame_and_id_of_its_own_file(
    tmp_path: File, crossed_at: float
) -> None:
    crosses = through((crossed_at - 2, 100, 400), (crossed_at + 2, 300, 400))
    gone_by = through((0, 300, 690), (5, 400, 690))
    first = write_part(tmp_path / FOLLOWING[0], 0, 10, gone_by, crosses)
    second = write_part(tmp_path / FOLLOWING[1], 10, 20, crosses)
    videos = count([first, second])
    events = [(event.frame, event.id) for event in videos[1].events]
    assert (len(videos[0].events), events) == (0, [(0, 1)])

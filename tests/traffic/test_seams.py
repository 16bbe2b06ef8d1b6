"""Files of tracks that follow one another: a vehicle on both sides of a seam counts once."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path as File
from typing import Any

import pytest

from traffic.scenes import CAR_HEIGHT, Path, settings_for, through, track
from vdet.config.scene import ClockSettings, LineSettings, ZoneSettings
from vdet.config.schema import InputSettings
from vdet.errors import TruthError
from vdet.labels.label import SourceVideo, TrackWriter
from vdet.labels.lines import JSON_LINES
from vdet.track.track import FrameTracks
from vdet.traffic.counting import count_files, natural_order
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


def write_part(
    path: File,
    first: float,
    last: float,
    *paths: Path,
    clock: float = -1,
    scale: float = 1,
    kind: str | None = None,
    height: float = CAR_HEIGHT,
) -> File:
    """Write a part of the tracks of 60 s into a file whose frames begin at 0.

    `clock` is its start in the file itself, seconds after 7:00; -1: only the name has it. `scale`
    is that of the frames, `kind` and `height` are those of the vehicles.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        size = round(1280 * scale), round(720 * scale)
        writer = TrackWriter(JSON_LINES, file, SourceVideo("v.mp4", *size))
        for index in range(round((last - first) * 25)):
            time = index / 25
            feet = {n: foot for n, p in enumerate(paths, 1) if (foot := p(round(first + time, 4)))}
            tracks = tuple(
                track((scale * x, scale * y), n, height=round(scale * height), name=kind)
                for n, (x, y) in feet.items()
            )
            begins = (CLOCK + timedelta(seconds=clock + time)).isoformat()
            facts = {"clock": begins} if clock >= 0 else {}
            writer.write(FrameTracks(index, time, tracks, facts))
        writer.end()
    return path


FOLLOWING = ["v_20260501_070000.jsonl", "v_20260501_070010.jsonl"]


def write_halves(folder: File, path: Path) -> list[File]:
    """Write the tracks of 20 s into two files."""
    starts = zip(FOLLOWING, (0, 10), strict=True)
    return [write_part(folder / name, first, first + 10, path) for name, first in starts]


def count(files: Sequence[File]) -> list[Counts]:
    return list(count_files(files, SETTINGS).values())


def test_a_vehicle_at_the_seam_is_one_flow(tmp_path: File) -> None:
    videos = count(write_halves(tmp_path, GOES_EAST))
    (row,) = flow_table(videos)
    assert (row.origin, row.destination, row.count) == ("west", "east", 1)
    assert [len(video.events) for video in videos] == [1, 1]
    assert videos[1].events[0].time == pytest.approx(8, abs=0.05), "in the time of its own file"


def test_a_vehicle_on_the_line_at_the_seam_counts_once(tmp_path: File) -> None:
    first, second = count(write_halves(tmp_path, ON_THE_LINE))
    assert [event.name for event in (*first.events, *second.events)] == ["west"]


def test_a_stay_goes_on_beyond_the_seam(tmp_path: File) -> None:
    (row,) = zone_table(count(write_halves(tmp_path, STANDS)))
    assert (row.entered, row.left, row.max) == (1, 1, 1)
    assert row.max_stay == pytest.approx(16, abs=0.05)


Flows = list[tuple[str, str | None, int]]


def flows_of(videos: Sequence[Counts]) -> Flows:
    return [(row.origin, row.destination, row.count) for row in flow_table(videos)]


ONE_VEHICLE: Flows = [("west", "east", 1)]
TWO_VEHICLES: Flows = [("west", None, 1), ("east", None, 1)]
JUMPS = through((0, 100, 400), (9.96, 600, 400), (10, 600, 250), (20, 1100, 250))
STOPS, GOES_ON = through((0, 100, 400), (30, 600, 400)), through((35, 600, 400), (45, 1100, 400))
FAST = through((0, 100, 400), (5.5, 1200, 400))
IN_A_LANE = [through((t, 100, 400), (t + 6, 1100, 400)) for t in (12, 20.5)]
Part = tuple[str, float, float, Sequence[Path], dict[str, Any]]
"""Name, first and last second, paths, and other arguments of `write_part`."""


def two(second: str = FOLLOWING[1], path: Path = GOES_EAST, **known: Any) -> list[Part]:
    """Return the first 10 s of a path, and the next 10 s in another file."""
    return [(FOLLOWING[0], 0, 10, [path], {}), (second, 10, 20, [path], known)]


SEAMS: dict[str, tuple[list[Part], Flows]] = {
    "a clock has whole seconds, this one early": (two("v_20260501_070009.jsonl"), ONE_VEHICLE),
    "a clock has whole seconds, this one late": (two("v_20260501_070011.jsonl"), ONE_VEHICLE),
    "the second has no clock": (two("b.jsonl"), TWO_VEHICLES),
    "the second begins an hour later": (two("v_20260501_080000.jsonl"), TWO_VEHICLES),
    "the same id goes on elsewhere": (two(path=JUMPS), TWO_VEHICLES),
    "the frames of the second are smaller": (two(scale=0.5), TWO_VEHICLES),
    "exact clocks show a short gap": (
        [("a_1.jsonl", 0, 2, [FAST], {"clock": 0.001}),
         ("a_2.jsonl", 2.52, 6, [FAST], {"clock": 2.521})],
        ONE_VEHICLE,
    ),
    "what files are longer than their slots does not add up before a pause": (
        [*((f"v_20260501_0700{s:02}.jsonl", s, s + 2.5, [STOPS], {}) for s in range(0, 30, 2)),
         ("v_20260501_070035.jsonl", 35, 45, [GOES_ON], {})],
        TWO_VEHICLES,
    ),
    "the next vehicle in a lane is no repeat": (
        [("v_20260501_070000.jsonl", 0, 20, IN_A_LANE, {}),
         ("v_20260501_070020.jsonl", 20, 40, IN_A_LANE, {})],
        [("west", "east", 2)],
    ),
    "a file within another counts nothing": (
        [("a.jsonl", 0, 20, [GOES_EAST], {"clock": 0}),
         ("b.jsonl", 0, 10, [GOES_EAST], {"clock": 0}),
         ("c.jsonl", 20, 30, [GOES_EAST], {"clock": 20})],
        ONE_VEHICLE,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SEAMS)
def test_a_vehicle_counts_once_where_files_follow_one_another(name: str, tmp_path: File) -> None:
    parts, flows = SEAMS[name]
    files = [
        write_part(tmp_path / part, first, last, *paths, **known)
        for part, first, last, paths, known in parts
    ]
    assert flows_of(count(files)) == flows


BEGINS = SETTINGS.model_copy(update={"input": InputSettings(begin="2026-01-02 03:04Z")})


def test_a_begin_is_that_of_the_first_of_several_files(tmp_path: File) -> None:
    files = write_halves(tmp_path, GOES_EAST)
    clocks = [str(counts.clock) for counts in count_files(files, BEGINS).values()]
    assert clocks == [f"2026-01-02 03:04:{second}+00:00 (as given)" for second in ("00", "10")]


@pytest.mark.parametrize(
    ("first", "second", "pattern"),
    [
        ("20260501_070000_000123NF", "20260501_070010_000124NR", None),
        (
            "RecM05_20260501_070000_070006_6D28808_1A468F9",
            "RecM05_20260501_070010_070016_6D28808_2C468F1",
            None,
        ),
        ("2026-05-01/20260501_070000", "2026-05-02/20260501_070010", None),
        ("2026-05-01/07/cam/00.00", "2026-05-01/07/cam/00.10", "%Y-%m-%d/%H/cam/%M.%S"),
        ("1777618800.123456-ab12cd", "1777618810.654321-ef34", "in the file"),
        ("video", "video (1)", "in the file"),
        ("b", "a", "in the file"),
    ],
)
def test_names_are_only_read_for_clocks(
    tmp_path: File, first: str, second: str, pattern: str | None
) -> None:
    has_clock = pattern == "in the file"
    files = [
        write_part(path, start, start + 10, GOES_EAST, clock=start if has_clock else -1)
        for path, start in ((tmp_path / f"{first}.jsonl", 0), (tmp_path / f"{second}.jsonl", 10))
    ]
    clock = ClockSettings(pattern=None if has_clock else pattern)
    camera = SETTINGS.camera.model_copy(update={"clock": clock})
    settings = SETTINGS.model_copy(update={"camera": camera})
    for order in (files, files[::-1]):
        videos = count_files(order, settings)
        assert list(videos) == list(map(str, files)), "in the order of time"
        assert flows_of(list(videos.values())) == ONE_VEHICLE


def test_files_without_a_clock_are_in_the_order_of_their_numbers() -> None:
    names = ["a/clip2", "a/clip10", "b/GX010016", "b/GX020016", "b/GOPR0017", "b/GP010017"]
    names += ["b/GX010018", "b/gx020018", "B/GX010019"]
    paths = [File(f"{name}.MP4.jsonl") for name in names]
    assert sorted(set(paths), key=natural_order) == paths


def test_a_begin_chains_files_in_the_order_of_their_numbers(tmp_path: File) -> None:
    names = [f"clip{number}.jsonl" for number in range(1, 13)]
    files = [write_part(tmp_path / name, 2 * n, 2 * n + 2) for n, name in enumerate(names)]
    videos = count_files(sorted(files), BEGINS)
    begins = [(File(name).name, str(counts.clock)[17:19]) for name, counts in videos.items()]
    assert begins == [(name, f"{2 * n:02}") for n, name in enumerate(names)]


def test_files_without_a_clock_are_counted_on_their_own_after_the_others(tmp_path: File) -> None:
    files = [
        write_part(tmp_path / name, first, first + 10, GOES_EAST)
        for name, first in (("a.jsonl", 0), *zip(FOLLOWING, (0, 10), strict=True), ("b.jsonl", 10))
    ]
    videos = count_files(files, SETTINGS)
    assert [File(name).name for name in videos] == [*FOLLOWING, "a.jsonl", "b.jsonl"]
    assert flows_of(list(videos.values())) == [
        ("west", "east", 1), ("west", None, 1), ("east", None, 1),
    ]  # fmt: skip


def test_tracks_of_two_files_that_share_an_id_are_two(tmp_path: File) -> None:
    halves = zip(FOLLOWING, ((0, "truck", 90), (10, "car", 60)), strict=True)
    files = [
        write_part(tmp_path / name, first, first + 10, GOES_EAST, kind=kind, height=height)
        for name, (first, kind, height) in halves
    ]
    videos = count(files)
    assert flows_of(videos) == ONE_VEHICLE
    events = [(event.class_name, event.id) for video in videos for event in video.events]
    assert events == [("truck", 1), ("truck", 1)], "the class that shows it largest, ids of files"


OVERLAPPING = [FOLLOWING[0], "v_20260501_070005.jsonl"]


@pytest.mark.parametrize("other", [GOES_EAST, through((5, 700, 300), (15, 200, 300))])
def test_an_overlap_with_other_vehicles_is_an_error(tmp_path: File, other: Path) -> None:
    files = [
        write_part(tmp_path / OVERLAPPING[0], 0, 10, GOES_EAST),
        write_part(tmp_path / OVERLAPPING[1], 8, 18, other),
    ]
    fault = f"{files[1]}: begins 5.0 s before the end of {files[0]} by their clocks, but shows "
    with pytest.raises(TruthError, match=re.escape(fault)):
        count(files)


def test_an_overlap_without_vehicles_loses_nothing(
    tmp_path: File, caplog: pytest.LogCaptureFixture
) -> None:
    parked = through((0, 300, 650), (60, 300, 650))
    late = through((10.1, 100, 400), (16, 1100, 400))
    files = [
        write_part(tmp_path / OVERLAPPING[0], 0, 10, parked),
        write_part(tmp_path / OVERLAPPING[1], 5, 18, parked, late),
    ]
    videos = count(files)
    assert (flows_of(videos), caplog.messages) == (ONE_VEHICLE, [])
    assert videos[1].spans == ((5, 12.96),)


def test_an_overlap_of_other_frame_sizes_is_left_out(
    tmp_path: File, caplog: pytest.LogCaptureFixture
) -> None:
    names = zip((FOLLOWING[0], "v_20260501_070004.jsonl"), (0, 4), (1.0, 0.5), strict=True)
    files = [write_part(tmp_path / n, s, s + 10, GOES_EAST, scale=scale) for n, s, scale in names]
    assert flows_of(count(files)) == [("west", None, 1)]
    assert "begins 6.0 s before the end of" in caplog.text


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

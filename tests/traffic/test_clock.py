"""When a video begins, and where that is known from."""

import os
import struct
import time
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from fractions import Fraction
from pathlib import Path

import av
import pytest
from pydantic import ValidationError

from clips import remuxed, write_clip
from conftest import Run
from vdet.config.scene import CameraSettings, ClockSettings, parse_date_time
from vdet.config.schema import InputSettings, Settings
from vdet.errors import ConfigError
from vdet.labels.label import SavedTracks
from vdet.media.frame import Tags
from vdet.media.reader import VideoReader
from vdet.traffic import clock as clock_module
from vdet.traffic.clock import Clock, Intervals, find_clock


@pytest.fixture(autouse=True)
def time_zone(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The zone of the computer: two hours before UTC in summer, one in winter."""
    monkeypatch.setitem(os.environ, "TZ", "CET-1CEST")
    monkeypatch.setattr(clock_module, "now", lambda: datetime(2026, 12, 1, tzinfo=UTC))
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


def write_copy(path: Path, **tags: str) -> Path:
    """Write a clip, and a copy of it with these tags."""
    source, flags = write_clip(path.with_stem("source")), {"movflags": "use_metadata_tags"}
    return remuxed(path, source, tags=tags, muxing=flags)


def clock_of(
    name: str | Path,
    given: str | None = None,
    created: str | None = None,
    *,
    pattern: str | None = None,
    zone: str | None = None,
    exporter: str | None = None,
    length: Fraction | None = None,
) -> Clock | None:
    camera = CameraSettings(clock=ClockSettings(pattern=pattern, zone=zone))
    settings = Settings(input=InputSettings(begin=given), camera=camera)
    tags = Tags(created, exporter=exporter)
    return find_clock(Path("clips", name), settings, tags=tags, length=length)


def test_a_time_that_is_given_is_taken() -> None:
    name, created = "a_20260501_070000.mp4", "2020-01-01T00:00:00Z"
    given = clock_of(name, "2026-05-01 07:00-03:00", created)
    assert str(given) == "2026-05-01 07:00:00-03:00 (as given)"
    assert str(clock_of(name, "2026-01-01 07:00")) == "2026-01-01 07:00:00+01:00 (as given)"


LOCAL = "2026-05-01T05:00:00+00:00"
NAMES = {
    **dict.fromkeys(
        (
            *("Gate_FR20_2026-05-01_07-00-00.mp4", "20260501_070000.mp4"),
            *("cam1-2026.05.01 07.00.00.ts", "REC2026-05-01T07-00-00.jsonl"),
            *("20260501T050000Z.mp4", "99999999_999999_20260501_070000.mp4"),
            *("DJI_20260501070000_0001_D.MP4", "2026_0501_070000_0001F.MP4"),
            *("20260501_070000-0001.mp4", "20260501_070000_left.720p.mp4"),  # a counter, a view
        ),
        LOCAL,
    ),
    "2026-05-01T05-00-00.123Z.mp4": "2026-05-01T05:00:00.123000+00:00",
    "2026-05-01T05-00-00-123Z.mp4": "2026-05-01T05:00:00.123000+00:00",
    "20260501T050000.123456789Z.mp4": "2026-05-01T05:00:00.123456+00:00",
    "20260501T070000.5+0200.mp4": "2026-05-01T05:00:00.500000+00:00",
    "20260501-123456+0200.mp4": "2026-05-01T10:34:56+00:00",
    "20260501_070000-05:00.mp4": "2026-05-01T12:00:00+00:00",
    "20260501_070000_UTC.mp4": "2026-05-01T07:00:00+00:00",
    "2026-05-01 at 01.04.56\u202fPM.mov": "2026-05-01T11:04:56+00:00",
    "2026-05-01 12.04.56 am.mov": "2026-04-30T22:04:56+00:00",
}
PATTERNS = {
    ("x1 01.05.26 07h00m00.mp4", "%d.%m.%y %Hh%Mm%S"): LOCAL,
    ("2019_1_14__16_6.mp4", "%Y_%m_%d__%H_%M"): "2019-01-14T15:06:00+00:00",
    ("2022-06-01/12/cam/05.33.mp4", "%Y-%m-%d/%H/cam/%M.%S"): "2022-06-01T10:05:33+00:00",
    ("1.5.26 1-4-56.25 PM +0300", "%d.%m.%y %I-%M-%S.%f %p %z"): "2026-05-01T10:04:56.250000+00:00",
}


@pytest.mark.parametrize(
    ("name", "pattern", "text"),
    [
        *((name, None, text) for name, text in NAMES.items()),
        *((name, pattern, text) for (name, pattern), text in PATTERNS.items()),
    ],
)
def test_a_time_in_the_name_is_local_time_unless_it_has_a_zone(
    name: str, pattern: str | None, text: str
) -> None:
    for created in (None, "", "1904-01-01T00:00:00Z", "yesterday"):
        clock = clock_of(name, None, created, pattern=pattern)
        assert clock is not None
        assert clock.zero.isoformat() == text
        assert str(clock).endswith("(from its name)")


@pytest.mark.parametrize("suffix", ["-0500", "UTC+2", " CEST", "+02"])
def test_a_zone_that_is_not_read_leaves_no_clock(
    suffix: str, caplog: pytest.LogCaptureFixture
) -> None:
    name = f"20260501_070000{suffix}.mp4"
    assert clock_of(name, created="2026-05-01T05:00:00Z") is None
    text = f"'{suffix.strip()}' after the time in its name may be a zone"
    advice = "set camera.clock.pattern, with %z for a zone"
    assert caplog.messages == [f"clips/{name}: {text}; {advice}"]


def test_saved_tracks_of_another_name_keep_their_clock() -> None:
    settings = Settings(camera=CameraSettings(clock=ClockSettings(pattern="%Y/%m/%d/%H.%M")))
    saved = SavedTracks({}, begin=parse_date_time("2026-05-01 07:00+02:00"))
    clock = find_clock(Path("05.33.jsonl"), settings, saved=saved)
    assert str(clock) == "2026-05-01 07:00:00+02:00 (from the file)"


@pytest.mark.parametrize("name", ["gate.mp4", "20261301_070000.mp4", "120260501_0700001.mp4"])
def test_without_a_time_in_the_name_the_creation_time_says_it(name: str) -> None:
    assert clock_of(name) is None
    found = clock_of(name, None, "2026-05-01T05:00:00.000000Z")
    assert str(found) == "2026-05-01 07:00:00+02:00 (its creation time)"


@pytest.mark.parametrize(
    ("created", "is_said"),
    [("2026-05-01T05:00:58Z", False), ("2026-05-01T07:00:00Z", True), ("2026-05-03T12:00Z", True)],
)
def test_a_name_and_metadata_that_disagree_are_both_said(
    created: str, is_said: bool, caplog: pytest.LogCaptureFixture
) -> None:
    found = clock_of("20260501_070000.mp4", None, created)
    assert str(found) == "2026-05-01 07:00:00+02:00 (from its name)"
    other = parse_date_time(created).astimezone().isoformat(" ", "seconds")
    said = f"begins 2026-05-01 07:00:00+02:00 by its name, {other} by its metadata"
    expected = f"clips/20260501_070000.mp4: {said}; using the name; input.begin overrides it"
    assert caplog.messages == [expected] * is_said
    caplog.clear()
    clock_of("20260501_070000.mp4", "2026-05-01 07:00", created)
    assert caplog.messages == []


def test_a_creation_time_at_the_end_of_the_video_is_no_contradiction(
    caplog: pytest.LogCaptureFixture,
) -> None:
    clock_of("20260501_070000.mp4", None, "2026-05-01T05:15:30Z", length=Fraction(900))
    assert caplog.messages == []


@pytest.mark.parametrize(
    ("created", "exporter", "text"),
    [
        ("2026-05-01T05:00Z", "x", "2026-05-01 07:00:00+02:00 (its creation time, perhaps of an e"),
        ("2027-05-01T05:00Z", None, "2027-05-01 07:00:00+02:00 (its creation time, in the future)"),
    ],
)
def test_the_creation_time_of_an_exported_file_is_doubtful_and_so_is_the_future(
    created: str, exporter: str | None, text: str, caplog: pytest.LogCaptureFixture
) -> None:
    text = text.replace("an e", "an export)") if exporter else text
    assert str(clock_of("a.mp4", None, created, exporter=exporter)) == text
    assert caplog.messages == [f"clips/a.mp4: may not begin {text}; input.begin overrides it"]


def test_the_clock_of_tracks_is_as_doubtful_as_that_of_their_video(
    tmp_path: Path, run: Run
) -> None:
    video = write_copy(tmp_path / "a.mp4", creation_time="2026-05-01T05:00:00Z")
    tracks, lines = tmp_path / "a.jsonl", tmp_path / "l.yaml"
    lines.write_text("traffic: {lines: [{name: gate, start: [0, 0.5], end: [1, 0.5]}]}")
    live = run("detect-video", video, "--no-video", "--tracks", tracks, code=0)
    again = run("count", tracks, "-c", lines, "--size", "160x96", code=0)
    text = "2026-05-01 07:00:00+02:00 (its creation time, perhaps of an export)"
    assert f"{video}: may not begin {text}; input.begin overrides it" in live.err
    assert f"{tracks}: may not begin {text}; input.begin overrides it" in again.err


@pytest.mark.parametrize(
    ("old", "new", "is_doubtful"),
    [
        (b"VideoHandler", b"VideoHandler", False),
        (b"VideoHandler", b"GPAC ISO Vid", True),
        (b"VideoHandler", b"L-SMASH Vide", True),
        (b"ftypisom", b"ftypdash", True),
        (b"isomiso2", b"isomdash", True),
        (b"Xavf", b"Lavf", True),
        (b"VideoHandler", b"Dashcam Vid.", False),
    ],
)
def test_a_file_that_was_wrapped_again_has_no_sure_clock(
    tmp_path: Path, old: bytes, new: bytes, *, is_doubtful: bool
) -> None:
    path = write_copy(tmp_path / "a.mp4", creation_time="2026-05-01T05:00:00Z")
    written = path.read_bytes().replace(b"Lavf", b"Xavf")
    assert old in written
    path.write_bytes(written.replace(old, new))
    with VideoReader(path) as reader:
        clock = find_clock(path, Settings(), tags=reader.info.tags)
    assert clock is not None
    assert clock.is_doubtful == is_doubtful


def test_the_key_of_apple_has_the_zone_and_is_not_of_an_export(tmp_path: Path) -> None:
    tags = {"com.apple.quicktime.creationdate": "2026-05-01T07:00:00-0300"}
    path = write_copy(tmp_path / "a.mov", creation_time="2026-06-01T00:00:00Z", **tags)
    with VideoReader(path) as reader:
        clock = find_clock(path, Settings(), tags=reader.info.tags)
    assert str(clock) == "2026-05-01 07:00:00-03:00 (its creation time)"


def test_a_time_zone_of_this_computer_that_is_missing_is_an_error() -> None:
    os.environ["TZ"] = ":/nonexistent"
    assert clock_of("20260501_070000.mp4", zone="Asia/Kolkata") is not None
    with pytest.raises(ConfigError, match=r"TZ: /nonexistent not found; set TZ or camera\.clock"):
        clock_of("20260501_070000.mp4")


def write_dav(path: Path) -> Path:
    """Write a recording of a camera whose clock says 7:00."""
    with av.open(write_clip(path.with_suffix(".h264"))) as source:
        packets = [bytes(packet) for packet in source.demux(video=0) if packet.size]
    date = 26 << 26 | 5 << 22 | 1 << 17 | 7 << 12  # a year has six bits, a minute and a second too
    extension = bytes([0x80, 0, 160 // 8, 96 // 8, 0x81, 0, 4, 25])  # the size; H.264, 25 a second
    with path.open("wb") as file:
        for number, packet in enumerate(packets):
            length = 24 + len(extension) + len(packet) + 8
            head = struct.pack("<4s4B3IH2B", b"DHAV", 0xFD, 1, 0, 0, number, length, date,
                               40 * number, len(extension), 0)  # fmt: skip
            file.write(head + extension + packet + struct.pack("<4sI", b"dhav", length))
    return path


def test_the_times_of_a_dav_recording_are_the_clock_of_its_camera(tmp_path: Path) -> None:
    with VideoReader(write_dav(tmp_path / "a.dav")) as reader:
        assert [float(frame.time) for frame in reader][:3] == [0, 0.04, 0.08]
        clock = find_clock(tmp_path / "a.dav", Settings(), tags=reader.info.tags)
    assert str(clock) == "2026-05-01 07:00:00+02:00 (its creation time)"


def test_pictures_that_are_named_by_the_clock_say_when_they_begin(tmp_path: Path) -> None:
    for name in ("20260501_070050.jpg", "20260501_070100.jpg"):
        (tmp_path / name).touch()
    assert str(clock_of(tmp_path)) == "2026-05-01 07:00:50+02:00 (from its name)"


def test_a_name_that_does_not_match_the_pattern_is_refused() -> None:
    with pytest.raises(
        ConfigError, match=r"b\.mp4: its name does not match camera\.clock\.pattern"
    ):
        clock_of("b.mp4", pattern="%Y_%H%M")


BERLIN = "Europe/Berlin"


class TestZone:
    def test_of_saved_tracks_is_that_of_this_computer_if_their_offset_is(self) -> None:
        os.environ["TZ"] = "CET-1CEST,M3.5.0,M10.5.0/3"
        time.tzset()
        live = clock_of("20261025_015000.mp4")
        assert live is not None
        for offset, later in (("+02:00", "2026-10-25 02:50:00+01:00"), ("-03:00", None)):
            saved = SavedTracks({}, begin=parse_date_time(f"2026-10-25 01:50:00{offset}"))
            clock = find_clock(Path("a"), Settings(), saved=saved)
            assert clock is not None
            assert str(clock.at(7200)) == (later or "2026-10-25 03:50:00-03:00")
            spans = [(0.0, 7200.0)]
            periods = [Intervals([(c, spans)], 3600).periods for c in (live, clock)]
            assert (periods[0] == periods[1]) == (later is not None)

    @pytest.mark.parametrize(
        ("name", "zone", "text"),
        [
            ("20260501_070000.mp4", "Asia/Kolkata", "2026-05-01 07:00:00+05:30"),
            ("20260501_070000Z.mp4", "Asia/Kolkata", "2026-05-01 12:30:00+05:30"),
            ("20260329_023000.mp4", "Europe/Berlin", "2026-03-29 03:30:00+02:00"),  # there is none
            ("20261025_023000.mp4", "Europe/Berlin", "2026-10-25 02:30:00+02:00"),  # the first
        ],
    )
    def test_of_names_and_tables_is_a_setting(self, name: str, zone: str, text: str) -> None:
        assert str(clock_of(name, zone=zone)) == f"{text} (from its name)"

    @pytest.mark.parametrize("zone", [None, BERLIN])
    def test_each_moment_has_the_offset_of_that_moment(self, zone: str | None) -> None:
        if zone is None:  # that of this computer
            os.environ["TZ"] = "CET-1CEST,M3.5.0,M10.5.0/3"
            time.tzset()
        found = clock_of("20261025_015000.mp4", zone=zone)
        assert found is not None
        moments = [str(found.at(seconds)) for seconds in (0, 3600, 7200)]
        assert moments == [
            "2026-10-25 01:50:00+02:00",
            "2026-10-25 02:50:00+02:00",
            "2026-10-25 02:50:00+01:00",
        ]
        intervals = Intervals([(found, [(0.0, 7200.0)])], 3600)
        starts = [str(period.start) for period in intervals.periods]
        assert starts == [
            "2026-10-25 01:00:00+02:00",
            "2026-10-25 02:00:00+02:00",
            "2026-10-25 02:00:00+01:00",
        ]

    @pytest.mark.parametrize(
        ("zone", "names", "length", "starts"),
        [
            (
                *("America/New_York", ("20260307_120000", "20260310_120000"), 86_400),
                ("2026-03-07 00:00:00-05:00", "2026-03-10 00:00:00-04:00"),
            ),
            (
                *("Australia/Lord_Howe", ("20260404_120000", "20260405_120000"), 3600),
                ("2026-04-04 12:00:00+11:00", "2026-04-05 12:00:00+10:30"),
            ),
            (
                *("America/New_York", ("20260308_013000", "20260308_033000"), 7200),
                ("2026-03-08 00:00:00-05:00", "2026-03-08 03:00:00-04:00"),  # there is no 02:00
            ),
            (
                *("Europe/Berlin", ("20261025_000500", "20261025_235500"), 86_400),
                ("2026-10-25 00:00:00+02:00",),  # a day of 25 hours
            ),
        ],
    )
    def test_intervals_begin_at_round_times_after_a_change_of_the_clock(
        self, zone: str, names: Iterable[str], length: int, starts: Iterable[str]
    ) -> None:
        clocks = [clock_of(f"{name}.mp4", zone=zone) for name in names]
        periods = Intervals([(clock, [(0.0, 60.0)]) for clock in clocks], length).periods
        assert [str(period.start) for period in periods] == list(starts)


@pytest.mark.parametrize("text", ["7 o'clock", "0001-01-01", "9000-12-31", "2026-05-01 25:00"])
def test_a_text_that_is_not_a_time_is_refused(text: str) -> None:
    with pytest.raises(ValidationError, match="is not a time; expected one such as"):
        InputSettings(begin=text)


@pytest.mark.parametrize("text", ["%Y%q", "100%", "clip", "%Y%I"])
def test_a_text_that_is_not_a_pattern_is_refused(text: str) -> None:
    with pytest.raises(ValidationError, match=r"a pattern can only contain|need each other"):
        ClockSettings(pattern=text)


def test_the_number_of_intervals_is_bounded() -> None:
    message = "traffic.interval: 1 s makes more than 200,000 intervals; use a longer one"
    with pytest.raises(ConfigError, match=message):
        Intervals([(None, [(0.0, 10_000_000.0)])], 1)

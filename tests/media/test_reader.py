"""The video reader: parts, damage, clocks that restart, streams without times."""

import struct
from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from clips import ODD, joined, read_number, remuxed, sound_of, write_clip
from vdet.config.schema import InputSettings, OutputSettings
from vdet.errors import VideoError
from vdet.media import Frame
from vdet.media.frame import Coding, ColorTags
from vdet.media.reader import Damage, Decoder, VideoReader, next_time
from vdet.media.writer import VideoWriter

Image = NDArray[np.uint8]
Warnings = Callable[[], list[str]]
GOPS: dict[str, Any] = {"options": {"g": "10", "bf": "2"}, "count": 60}
TICK = Fraction(1, 1000)
PERIOD = Fraction(1, 25)


def cut_off(path: Path, fraction: float) -> Path:
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * fraction)])
    return path


def fragments(path: Path, first: int, **spec: Any) -> Path:
    """Write a fragmented clip without the fragments before `first`, of ten frames each."""
    write_clip(path, movflags="+frag_keyframe+empty_moov+default_base_moof", **GOPS, **spec)
    data, boxes, at = path.read_bytes(), list[tuple[bytes, bytes]](), 0
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at : at + 8])
        boxes.append((kind, data[at : at + size]))
        at += size
    media = [box for kind, box in boxes if kind in (b"moof", b"mdat")]
    head = [box for kind, box in boxes if kind in (b"ftyp", b"moov")]
    path.write_bytes(b"".join([*head, *media[2 * first :]]))
    return path


def write_transparent(path: Path, codec: str) -> Path:
    """Write twelve frames whose transparency is noise."""
    rng = np.random.default_rng(0)
    with av.open(str(path), "w") as container:
        options = {"auto-alt-ref": "0", "deadline": "realtime"}
        stream = container.add_stream(codec, rate=25, options=options)
        assert isinstance(stream, av.VideoStream)
        stream.width, stream.height, stream.pix_fmt = 160, 96, "yuva420p"
        for number in range(12):
            noise = rng.integers(0, 256, (96, 160, 4), dtype=np.uint8)
            frame = av.VideoFrame.from_ndarray(noise, format="rgba").reformat(format="yuva420p")
            frame.pts, frame.time_base = number, PERIOD
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        ({}, range(12)),
        ({"start": Fraction(3, 25)}, range(3, 12)),
        ({"end": Fraction(3, 25)}, range(3)),
        ({"start": Fraction(1, 10), "end": Fraction(1, 5)}, range(3, 5)),
        ({"frames": 4}, range(4)),
        ({"start": Fraction(2, 25), "frames": 1}, range(2, 3)),
        ({"start": Fraction(2, 25), "end": Fraction(4, 25), "frames": 5}, range(2, 4)),
        ({"frames": 0}, range(0)),
        ({"start": Fraction(9)}, range(0)),
        ({"start": Fraction(10**13)}, range(0)),
    ],
)
@pytest.mark.parametrize("suffix", ["mp4", "ts"])
def test_frames_from_start_to_before_end(
    limits: dict[str, Any], expected: range, suffix: str, *, tmp_path: Path
) -> None:
    path = write_clip(tmp_path / f"clip.{suffix}")  # the first frame of a .ts is not at 0
    with VideoReader(path, **limits) as reader:
        read = list(reader)
        assert reader.expected == len(expected)
    assert [frame.index for frame in read] == list(expected)
    assert [read_number(frame.image) for frame in read] == list(expected)
    assert [frame.time for frame in read] == [Fraction(index, 25) for index in expected]


def test_other_video_streams_are_reported(tmp_path: Path, warnings: Warnings) -> None:
    path = remuxed(tmp_path / "both.mp4", write_clip(tmp_path / "front.mp4"), copies=2)
    with VideoReader(path) as reader:
        assert [read_number(frame.image) for frame in reader] == list(range(12))
    assert warnings() == [f"{path}: has 2 video streams; only the first is used"]


@pytest.mark.parametrize(("captured", "is_slow"), [("120.000000", True), ("25.000000", False)])
def test_slow_motion_is_reported(
    captured: str, is_slow: bool, tmp_path: Path, warnings: Warnings
) -> None:
    source, flags = write_clip(tmp_path / "source.mp4"), {"movflags": "+use_metadata_tags"}
    tags = {"com.android.capture.fps": captured}
    path = remuxed(tmp_path / "clip.mp4", source, tags=tags, muxing=flags)
    with VideoReader(path) as reader:
        assert len(list(reader)) == 12
    rates = "recorded at 120 frames per second, shown at 25"
    words = f"{path}: is slow motion: {rates}; speeds are too low by this ratio"
    assert warnings() == [words] * is_slow


def write_hdr(path: Path, transfer: int, lumas: list[int]) -> Path:
    """Write grey columns of 10 bits with a transfer of BT.2100 and primaries of BT.2020."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate=25)
        assert isinstance(stream, av.VideoStream)
        stream.width, stream.height, stream.pix_fmt = 160, 96, "yuv420p10le"
        context = stream.codec_context
        context.color_trc, context.color_primaries, context.colorspace = transfer, 9, 9
        context.color_range = 1
        planes = np.full((144, 160), 512, np.uint16)
        planes[:96] = np.repeat(lumas, 160 // len(lumas))
        frame = av.VideoFrame.from_ndarray(planes, format="yuv420p10le")
        container.mux(stream.encode(frame) + stream.encode(None))
    return path


def hdr_signal(transfer: int, fraction: float) -> float:
    """Return the signal of a fraction of reference white, 203 cd/m² (BT.2100, BT.2408)."""
    if transfer == 16:
        power = (203 * fraction / 10_000) ** 0.1593017578125
        return float(((0.8359375 + 18.8515625 * power) / (1 + 18.6875 * power)) ** 78.84375)
    scene = (0.203 * fraction) ** (1 / 1.2)
    if scene <= 1 / 12:
        return float(np.sqrt(3 * scene))
    return float(0.17883277 * np.log(12 * scene - 0.28466892) + 0.55991073)


@pytest.mark.parametrize("transfer", [16, 18])
def test_hdr_is_read_as_standard_range(transfer: int, tmp_path: Path, warnings: Warnings) -> None:
    fractions = np.array([0, 0.01, 0.18, 0.5])
    lumas = [round(64 + 876 * hdr_signal(transfer, fraction)) for fraction in fractions]
    with VideoReader(write_hdr(tmp_path / "hdr.mkv", transfer, lumas)) as reader:
        (frame,) = reader
        assert reader.info.color == ColorTags(1, 1, 1)
    expected = 255 * fractions ** (1 / 2.4)
    assert np.abs(frame.image[:, 20::40] - expected[:, None]).max() < 5
    assert warnings() == []


def pictures_of(path: Path) -> list[av.VideoFrame]:
    """Decode a file without the reader."""
    with av.open(str(path)) as container:
        return list(container.decode(video=0))


PLANAR = {
    "constant rate": Coding(), "BT.601": Coding(), "BT.709": Coding("bt709"),
    "full range": Coding(full_range=True), "BT.709, full range": Coding("bt709", full_range=True),
    "motion jpeg": Coding(full_range=True), "odd sides, 4:2:0": Coding(), "grey": Coding(),
    "mpeg-4 with b-frames": Coding(), "vp9": Coding(),
}  # fmt: skip
"""How the odd clips are coded that are read as planes."""


@pytest.mark.parametrize("kind", PLANAR)
@pytest.mark.parametrize("start", [None, Fraction(5, 25)])
def test_planes_are_those_of_the_decoder(
    kind: str, start: Fraction | None, *, tmp_path: Path
) -> None:
    """Frames that need no conversion are given as they were decoded; others are BGR."""
    coding, (suffix, spec) = PLANAR[kind], ODD[kind]
    path = write_clip(tmp_path / f"clip.{suffix}", **spec | {"count": 12})
    pictures = pictures_of(path)
    with VideoReader(path, start=start) as reader:
        assert reader.info.coding == coding
        frames = list(reader)
    assert len(frames) == (12 if start is None else 7)
    for frame in frames:
        planes = frame.picture.planes
        assert planes is not None
        assert planes.coding == coding
        assert not planes.is_writable, "the decoder may need it for the next frames"
        height, width = planes.shape
        assert (reader.info.width, reader.info.height) == (width, height)
        decoded = pictures[frame.index]
        for layer, plane in zip(planes.layers, decoded.planes, strict=True):
            rows = np.frombuffer(bytes(plane), np.uint8).reshape(-1, plane.line_size)
            np.testing.assert_array_equal(layer, rows[: layer.shape[0], : layer.shape[1]])
        other = decoded.to_ndarray(format="bgr24").astype(int)
        assert np.abs(frame.image - other).mean() < 3


@pytest.mark.parametrize("codec", [("libx264", "bf=3:b-adapt=0"), ("mpeg4", "bf=2:q=2")])
def test_empty_packets_of_avi_are_pauses_also_with_b_frames(
    codec: tuple[str, str], tmp_path: Path, warnings: Warnings
) -> None:
    name, options = codec
    times = [2 * number * PERIOD for number in range(40)]  # 12.5 per second, at a rate of 25
    coding = dict(option.split("=") for option in options.split(":"))
    path = write_clip(tmp_path / "clip.avi", codec=name, times=times, options=coding)
    with VideoReader(path) as reader:
        frames = list(reader)
    assert [frame.time for frame in frames] == times
    assert [read_number(frame.image) for frame in frames] == list(range(40))
    assert warnings() == []


def test_info_is_what_the_file_declares(tmp_path: Path) -> None:
    rate = Fraction(30_000, 1001)
    path = write_clip(tmp_path / "a.mp4", rate=rate, matrix=1, sounds=["aac"])
    with VideoReader(path) as reader:
        info = reader.info
    assert (info.path, info.rate, info.time_base) == (path, rate, Fraction(1, 90_000))
    assert (info.start, info.pixel_aspect) == (Fraction(0), Fraction(1))
    assert info.frames == 12
    assert info.duration == pytest.approx(12 / rate, abs=0.001)
    assert (info.color.matrix, info.color.primaries, info.color.transfer) == (1, 2, 2)
    assert info.has_audio


class TestFaults:
    @pytest.mark.parametrize(
        ("suffix", "flags"),
        [("mkv", ""), ("mp4", "+faststart"), ("mp4", "+frag_keyframe+empty_moov"), ("ts", "")],
    )
    def test_a_clip_cut_off_gives_the_frames_before_the_cut(
        self, suffix: str, flags: str, *, tmp_path: Path, warnings: Warnings
    ) -> None:
        path = cut_off(write_clip(tmp_path / f"cut.{suffix}", **GOPS, movflags=flags), 0.6)
        with VideoReader(path) as reader:
            numbers = [read_number(frame.image) for frame in reader]
        assert numbers[:20] == list(range(20))
        assert numbers == sorted(set(numbers))  # B-frames just before the cut may be missing
        if suffix == "mkv" or flags == "+faststart":  # these declare their length
            (warning,) = warnings()
            assert warning.startswith(f"{path}: ")
            assert f"ends early: {len(numbers)} of 60 frames could be read" in warning
        else:
            assert len(warnings()) <= 1

    @pytest.mark.parametrize("codec", ["libvpx", "libvpx-vp9"])
    def test_transparency_between_the_packets_is_no_damage(
        self, codec: str, tmp_path: Path, warnings: Warnings
    ) -> None:
        path = write_transparent(tmp_path / "clip.webm", codec)
        with VideoReader(path) as reader:
            assert len(list(reader)) == 12
            assert reader.damaged == 0
        assert warnings() == []

    def test_an_mp4_may_begin_within_a_group_of_pictures(
        self, tmp_path: Path, warnings: Warnings
    ) -> None:
        path = remuxed(tmp_path / "part.mp4", write_clip(tmp_path / "whole.mp4", **GOPS), first=4)
        with VideoReader(path) as reader:
            assert [read_number(frame.image) for frame in reader] == list(range(10, 60))
            assert reader.length == 2
        assert warnings() == []

    @pytest.mark.parametrize("name", ["clip.mp4", "clip.mov"])
    def test_a_raw_stream_may_be_named_as_another_format(
        self, name: str, tmp_path: Path, warnings: Warnings
    ) -> None:
        path = write_clip(tmp_path / "clip.h264").rename(tmp_path / name)
        assert path.read_bytes().startswith(b"\0\0\0\1")  # as the length of a box: 64 bits follow
        with VideoReader(path) as reader:
            assert [read_number(frame.image) for frame in reader] == list(range(12))
        assert warnings() == []

    def test_an_mp4_without_its_index_is_refused(self, tmp_path: Path) -> None:
        path = cut_off(write_clip(tmp_path / "cut.mp4", **GOPS), 0.3)
        with pytest.raises(VideoError, match=r"cut\.mp4: .* is not a video, or was cut off"):
            VideoReader(path)


def test_pixels_that_cannot_be_converted_are_one_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> Image:
        raise av.error.InvalidDataError(1, "no such conversion")

    path = write_clip(tmp_path / "fine.mp4", pix_fmt="yuv444p")
    monkeypatch.setattr("vdet.media.reader.bgr_of", refuse)
    with (
        VideoReader(path) as reader,
        pytest.raises(VideoError, match=r"fine\.mp4: its pixels \(yuv444p\) cannot be converted"),
    ):
        list(reader)


@pytest.mark.parametrize("address", ["rtsp://camera/1", "https://host/a.mp4", "udp://@:1234"])
def test_an_address_is_refused(address: str) -> None:
    with pytest.raises(VideoError, match="streams are not supported; save it to a file first"):
        VideoReader(Path(address))


def clock_times(*stamps: int | None) -> list[Fraction]:
    times: list[Fraction] = []
    for stamp in stamps:
        stated = None if stamp is None else stamp * TICK
        times.append(next_time(times[-1] if times else None, stated, PERIOD))
    return times


@given(st.lists(st.none() | st.integers(-(2**40), 2**40)))
def test_times_always_increase(stamps: list[int | None]) -> None:
    assert all(earlier < later for earlier, later in pairwise(clock_times(*stamps)))


@pytest.mark.parametrize("first", [0, 3])
@pytest.mark.parametrize("sounds", [[], ["aac"]])
def test_fragments_end_where_their_last_frame_does(
    tmp_path: Path, first: int, sounds: list[str], warnings: Warnings
) -> None:
    path = fragments(tmp_path / "a.mp4", first, sounds=sounds)
    seconds = 60 * PERIOD - first * 10 * PERIOD
    with VideoReader(path) as reader:
        assert reader.length == seconds
        assert reader.info.frames == 60 - 10 * first
        assert [read_number(frame.image) for frame in reader] == list(range(10 * first, 60))
        assert reader.length == seconds
    assert warnings() == []


OPEN = {"g": "10", "bf": "2", "x264-params": "open-gop=1"}
FRAGMENTS = {"movflags": "+frag_keyframe+empty_moov"}
MPEG = {"codec": "mpeg2video", "options": {"g": "10", "bf": "2", "q": "2"}}
VP9 = {"codec": "libvpx-vp9", "options": {"deadline": "realtime", "g": "10"}}
LATE = {"begin": Fraction(3600)}
UNEVEN = [Fraction(number * number, 250) for number in range(60)]
CLIPS: dict[str, tuple[str, dict[str, Any]]] = {
    "mp4": ("mp4", {}),
    "mp4 with sound": ("mp4", {"sounds": ["aac"]}),
    "mov, open gops": ("mov", {"options": OPEN}),
    "fragments, open gops": ("mp4", {"options": OPEN, **FRAGMENTS}),
    "uneven times": ("mp4", {"times": UNEVEN}),
    "no edit list": ("mp4", {"muxing": {"use_editlist": "0"}}),
    "mkv, open gops": ("mkv", {"options": OPEN, "sounds": ["aac"], **LATE}),
    "transport stream, open gops": ("ts", {"options": OPEN, "sounds": ["aac"]}),
    "program stream": ("vob", {"sounds": ["mp2"], **MPEG}),
    "vp9": ("webm", VP9),
}
NOT_SURE: dict[str, tuple[str, dict[str, Any]]] = {
    "no times": ("h264", {}),
    "avi": ("avi", {}),
    "hidden frames": ("webm", {"codec": "libvpx", "options": {"auto-alt-ref": "1", "g": "10"}}),
    "intra refresh": ("mp4", {"options": {"g": "20", "bf": "0", "x264-params": "intra-refresh=1"}}),
    "intra refresh, b-frames": ("mkv", {"options": {"g": "20", "x264-params": "intra-refresh=1"}}),
    "interlaced": ("mp4", {"options": {"g": "10", "flags": "+ildct+ilme", "x264-params": "tff=1"}}),
}


@pytest.fixture
def decoded(monkeypatch: pytest.MonkeyPatch) -> list[None]:
    """Has an item for each picture that was decoded."""
    calls: list[None] = []
    receive = Damage.receive

    def counted(damage: Damage, picture: av.VideoFrame) -> bool:
        calls.append(None)
        return receive(damage, picture)

    monkeypatch.setattr(Damage, "receive", counted)
    return calls


def read_from(path: Path, start: Fraction | None = None) -> list[Frame]:
    with VideoReader(path, start=start) as reader:
        return list(reader)


def assert_part(part: list[Frame], whole: list[Frame], start: Fraction) -> None:
    expected = [frame for frame in whole if frame.time - whole[0].time >= start]
    assert [frame.index for frame in part] == [frame.index for frame in expected]
    assert [frame.time for frame in part] == [frame.time for frame in expected]
    for one, other in zip(part, expected, strict=True):
        np.testing.assert_array_equal(one.image, other.image)


@pytest.mark.parametrize("name", CLIPS)
def test_a_part_is_that_of_the_whole_and_the_frames_before_are_not_decoded(
    name: str, tmp_path: Path, decoded: list[None]
) -> None:
    suffix, spec = CLIPS[name]
    path = write_clip(tmp_path / f"clip.{suffix}", **GOPS | spec)
    whole = read_from(path)
    for number in (1, 9, 10, 11, 38, 40, 55, 59):
        start = whole[number].time - whole[0].time
        decoded.clear()
        assert_part(read_from(path, start), whole, start)
        assert len(decoded) < 60 - number + 35


@pytest.mark.parametrize("name", NOT_SURE)
def test_where_frames_cannot_be_counted_all_are_decoded(
    name: str, tmp_path: Path, decoded: list[None]
) -> None:
    suffix, spec = NOT_SURE[name]
    path = write_clip(tmp_path / f"clip.{suffix}", **GOPS | spec)
    whole = read_from(path)
    decoded.clear()
    start = Fraction(2)
    assert_part(read_from(path, start), whole, start)
    assert len(decoded) >= 60


@pytest.mark.parametrize("name", [*CLIPS, *NOT_SURE])
def test_a_copy_must_begin_at_a_key_frame_that_is_shown(name: str, tmp_path: Path) -> None:
    suffix, spec = (CLIPS | NOT_SURE)[name]
    decoder = Decoder(write_clip(tmp_path / f"clip.{suffix}", **GOPS | spec), None)
    has_times = suffix != "h264"
    assert decoder.shows_key_frame() == (has_times and "intra refresh" not in name)
    decoder.demuxer.close()


def test_a_start_after_a_clock_that_restarts(tmp_path: Path) -> None:
    clip = write_clip(tmp_path / "clip.ts", sounds=["aac"], **GOPS)
    path = joined(tmp_path / "joined.ts", clip, clip)
    assert_part(read_from(path, Fraction(4)), read_from(path), Fraction(4))


SLOW = Fraction(25, 2)
CODECS = {"h264": "libx264", "hevc": "libx265", "m2v": "mpeg2video", "h263": "h263"}
"""Streams that state their rate."""
RATES = {"m2v": Fraction(24), "h263": Fraction(30_000, 1001)}  # no others, or few


def read_raw(
    path: Path, rate: float | None = None
) -> tuple[list[Fraction], Fraction, Fraction | None]:
    """Return the times of the frames, the rate, and the length."""
    with VideoReader(path, settings=InputSettings(frame_rate=rate)) as reader:
        times = [frame.time for frame in reader]
        return times, reader.info.rate, reader.length


@pytest.mark.parametrize("suffix", CODECS)
def test_the_rate_is_that_of_the_stream(suffix: str, tmp_path: Path, warnings: Warnings) -> None:
    rate = RATES.get(suffix, SLOW)
    spec: dict[str, Any] = {"codec": CODECS[suffix], "rate": rate, "size": (176, 144)}
    path = write_clip(tmp_path / f"clip.{suffix}", count=30, **spec)
    assert read_raw(path) == ([number / rate for number in range(30)], rate, 30 / rate)
    assert read_raw(path, 10)[1] == 10
    assert warnings() == []
    clip = write_clip(tmp_path / "clip.mp4", count=2)
    with pytest.raises(VideoError, match="has a frame rate of its own; remove input"):
        read_raw(clip, 10)


@pytest.mark.parametrize("given", [None, 12.5, 50])
@pytest.mark.parametrize(
    ("suffix", "spec"),
    [
        ("mjpeg", {"codec": "mjpeg", "pix_fmt": "yuvj420p", "rate": SLOW}),
        *(("h264", {"rate": unit}) for unit in map(Fraction, ("600", "1000", "1/25"))),
    ],
)
def test_a_stream_without_a_usual_rate_has_that_of_the_settings(
    suffix: str, spec: dict[str, Any], given: float | None, tmp_path: Path, warnings: Warnings
) -> None:
    rate = Fraction(given or 25)
    path = write_clip(tmp_path / f"clip.{suffix}", count=30, **spec)
    assert read_raw(path, given) == ([number / rate for number in range(30)], rate, 30 / rate)
    assumed = f"{path}: 25 frames per second are assumed; set input.frame_rate"
    assert warnings() == [assumed] * (given is None)


KINDS: dict[str, dict[str, Any]] = {
    "ts": {"codec": "libx264", "sounds": ["aac"], "options": {"g": "10", "bf": "2"}},
    "vob": {"codec": "mpeg2video", "sounds": ["mp2"], "options": {"g": "10", "bf": "2"}},
}
COUNT = 30
PAUSE = Fraction(1, 5)  # at most, from part to part


def copy(source: Path) -> tuple[list[int], list[Fraction], Path]:
    """Copy a clip; return the numbers of its frames, their times, and the copy."""
    target = source.with_name("copy.mkv")
    with (
        VideoReader(source) as reader,
        VideoWriter(target, reader.info, OutputSettings(preset="ultrafast")) as writer,
    ):
        frames = list(reader)
        for frame in frames:
            writer.write(frame)
        assert reader.damaged == 0
    numbers = [read_number(frame.image) for frame in frames]
    return numbers, [frame.time - frames[0].time for frame in frames], target


def sound(path: Path) -> list[tuple[Fraction, bytes]]:
    """Return the packets; those of AAC in a transport stream have a header."""
    header = 7 if path.suffix == ".ts" else 0
    return [(time, data[header:]) for time, data in sound_of(path)]


def part(folder: Path, kind: str, begin: int = 0) -> Path:
    name = f"{begin}.{kind}"
    return write_clip(folder / name, count=COUNT, begin=Fraction(begin), **KINDS[kind])


@pytest.mark.parametrize(
    ("kind", "begins"),
    [
        ("ts", [0, 0]),
        ("vob", [0, 0]),
        ("ts", [0, 100, 0]),  # goes forth and back
        ("ts", [1000, 0]),  # FFmpeg takes it for a clock of 33 bits that overflows
    ],
)
def test_all_frames_and_all_sound_follow_one_another(
    kind: str, begins: list[int], *, tmp_path: Path, warnings: Warnings
) -> None:
    parts = [part(tmp_path, kind, begin) for begin in begins]
    source = joined(tmp_path / f"joined.{kind}", *parts)
    numbers, times, target = copy(source)
    assert numbers == list(range(COUNT)) * len(parts)
    steps = [later - earlier for earlier, later in pairwise(times)]
    within = [step for number, step in enumerate(steps, start=1) if number % COUNT]
    assert set(within) == {PERIOD}
    assert all(PERIOD <= step <= PAUSE for step in steps)

    heard = sound(target)
    expected = [data for part in parts for _, data in sound(part)]
    first = expected.index(heard[0][1])  # mkv holds none from before the first frame
    assert first <= 2
    assert [data for _, data in heard] == expected[first:]
    gaps = [later - earlier for (earlier, _), (later, _) in pairwise(heard)]
    assert all(0 < gap <= PAUSE for gap in gaps)
    count = len(parts) - 1
    assert warnings() == [f"{source}: its clock restarts {count}×; the parts follow one another"]


def test_picture_and_sound_of_each_part_stay_in_step(tmp_path: Path) -> None:
    clip = part(tmp_path, "ts")
    _, times, target = copy(joined(tmp_path / "joined.ts", clip, clip))
    alone = sound(clip)
    second = sound(target)[-len(alone) :]
    assert float(second[0][0] - times[COUNT]) == pytest.approx(float(alone[0][0]), abs=0.002)


def test_a_pause_of_the_pictures_is_kept_while_the_sound_goes_on(
    tmp_path: Path, warnings: Warnings
) -> None:
    times = [Fraction(index, 25) + (12 if index >= 20 else 0) for index in range(COUNT)]
    clip = write_clip(tmp_path / "pause.ts", times=times, **KINDS["ts"])
    numbers, found, _ = copy(clip)
    assert numbers == list(range(COUNT))
    assert found == times
    assert not any("clock" in warning for warning in warnings())

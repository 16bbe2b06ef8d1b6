"""The video reader: parts of a file, damaged files, files that are no videos, and frame times."""

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

from clips import ODD, read_number, write_clip
from vdet.errors import VideoError
from vdet.media.frame import Coding, ColorTags
from vdet.media.images import Orientation
from vdet.media.reader import VideoReader, next_time

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


def set_matrix(path: Path, a: float, b: float, c: float, d: float) -> Path:
    """Set what becomes of x (a, b) and of y (c, d) in the track header of an MP4 file."""
    data = bytearray(path.read_bytes())
    place = data.index(b"tkhd") + 44
    values = [round(value * 65_536) for value in (a, b, 0, c, d, 0, 0, 0)]
    struct.pack_into(">9i", data, place, *values, 1 << 30)
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("turns", range(4))
def test_all_quarter_turns_are_upright(turns: int, tmp_path: Path) -> None:
    path = write_clip(tmp_path / "clip.mp4", count=1)
    with VideoReader(path) as reader:
        stored = next(iter(reader)).image
    matrix = np.linalg.matrix_power(np.array([[0, -1], [1, 0]]), turns)
    with VideoReader(set_matrix(path, *matrix.ravel() * 0.5)) as reader:
        image = next(iter(reader)).image
        assert reader.info.orientation == Orientation(turns * 90)
        assert image.shape == (reader.info.height, reader.info.width, 3)
    np.testing.assert_array_equal(image, np.rot90(stored, turns))


def test_other_video_streams_are_reported(tmp_path: Path, warnings: Warnings) -> None:
    source, path = write_clip(tmp_path / "front.mp4"), tmp_path / "both.mp4"
    with av.open(str(source)) as front, av.open(str(path), "w") as target:
        copies = [target.add_stream_from_template(front.streams.video[0]) for _ in range(2)]
        for packet in front.demux(video=0):
            for copy in copies if packet.size else []:
                packet.stream = copy
                target.mux(packet)
    with VideoReader(path) as reader:
        assert [read_number(frame.image) for frame in reader] == list(range(12))
    assert warnings() == [f"{path}: has 2 video streams; only the first is used"]


@pytest.mark.parametrize(("captured", "is_slow"), [("120.000000", True), ("25.000000", False)])
def test_slow_motion_is_reported(
    captured: str, is_slow: bool, tmp_path: Path, warnings: Warnings
) -> None:
    source, path = write_clip(tmp_path / "source.mp4"), tmp_path / "clip.mp4"
    flags = {"movflags": "+use_metadata_tags"}
    with av.open(str(source)) as read, av.open(str(path), "w", container_options=flags) as written:
        written.metadata["com.android.capture.fps"] = captured
        stream = written.add_stream_from_template(read.streams.video[0])
        for packet in read.demux(video=0):
            if packet.size:
                packet.stream = stream
                written.mux(packet)
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
        source, path = write_clip(tmp_path / "whole.mp4", **GOPS), tmp_path / "part.mp4"
        with av.open(str(source)) as whole, av.open(str(path), "w") as part:
            copy = part.add_stream_from_template(whole.streams.video[0])
            for packet in [item for item in whole.demux(video=0) if item.size][4:]:
                packet.stream = copy
                part.mux(packet)
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

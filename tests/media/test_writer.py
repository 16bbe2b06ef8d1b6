"""The video writer: what it writes, with the sound of the source, complete or not at all."""

import os
import re
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

import vdet
from clips import draw_frame, read_number, sound_of, write_clip
from vdet.config.schema import OutputSettings
from vdet.errors import OutputError, VideoError
from vdet.files import staged
from vdet.media import ColorTags, Frame, Picture, VideoInfo
from vdet.media.frame import Coding, Tags
from vdet.media.reader import VideoReader
from vdet.media.writer import VideoWriter, may_replace_video

FAST = OutputSettings(preset="ultrafast")
INFO = VideoInfo(Path("unused"), 160, 96, Fraction(25), Fraction(1, 12_800))


@pytest.fixture
def frames() -> list[Frame]:
    """Twelve frames, the first at 7 s."""
    return [
        Frame(index, 7 + Fraction(index, 25), Picture(draw_frame(index, 160, 96)))
        for index in range(12)
    ]


def write(path: Path, frames: Iterable[Frame], info: VideoInfo = INFO) -> Path:
    with staged(path) as temporary, VideoWriter(temporary, info, FAST, name=path) as writer:
        for frame in frames:
            writer.write(frame)
    return path


def read(path: Path) -> list[Frame]:
    with VideoReader(path) as reader:
        return list(reader)


def listing(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


class TestMark:
    """What vdet wrote can be told from what it did not write."""

    @pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv"])
    def test_every_kind_of_file_has_the_mark(
        self, suffix: str, frames: list[Frame], tmp_path: Path
    ) -> None:
        path = write(tmp_path / f"out{suffix}", frames)
        with av.open(str(path)) as container:
            tags = {key.lower(): value for key, value in container.metadata.items()}
        assert tags["comment"] == f"made by vdet {vdet.__version__}"
        assert may_replace_video(path)
        path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
        assert may_replace_video(path), "it is damaged, and vdet wrote it all the same"

    @pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv", ".avi", ".ts"])
    @pytest.mark.parametrize("fraction", [1, 0.7])
    def test_other_videos_do_not_even_if_they_are_cut_off(
        self, suffix: str, fraction: float, tmp_path: Path
    ) -> None:
        path = write_clip(tmp_path / f"in{suffix}", count=60)
        path.write_bytes(path.read_bytes()[: int(path.stat().st_size * fraction)])
        assert not may_replace_video(path)


class TestFile:
    @pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv", ".MP4"])
    def test_the_first_frame_is_at_second_0(
        self, suffix: str, frames: list[Frame], tmp_path: Path
    ) -> None:
        written = read(write(tmp_path / f"out{suffix}", frames))
        assert [read_number(frame.image) for frame in written] == list(range(12))
        assert [frame.time for frame in written] == [Fraction(index, 25) for index in range(12)]

    def test_uneven_times_are_exact(self, frames: list[Frame], tmp_path: Path) -> None:
        ticks = [5, 6, 700, 701, 90_000, 90_013, 90_014, 10**7, 10**7 + 1, 10**7 + 2, 10**8, 10**9]
        base = Fraction(1, 30_000)
        moved = [
            replace(frame, time=tick * base) for frame, tick in zip(frames, ticks, strict=True)
        ]
        written = read(write(tmp_path / "out.mp4", moved, replace(INFO, time_base=base)))
        assert [frame.time for frame in written] == [(tick - 5) * base for tick in ticks]

    def test_a_browser_can_play_the_file_while_it_loads(
        self, frames: list[Frame], tmp_path: Path
    ) -> None:
        data = write(tmp_path / "out.mp4", frames).read_bytes()
        assert data.index(b"moov") < data.index(b"mdat")
        with av.open(str(tmp_path / "out.mp4")) as container:
            context = container.streams.video[0].codec_context
            assert (context.name, context.pix_fmt) == ("h264", "yuv420p")

    @pytest.mark.parametrize(
        ("source", "coding", "written"),
        [
            (ColorTags(), Coding(), ColorTags()),
            (ColorTags(), Coding(full_range=True), ColorTags()),
            (ColorTags(1, 1, 5), Coding(), ColorTags(1, 1, 6)),
            (ColorTags(1, 1, 1), Coding("bt709"), ColorTags(1, 1, 1)),
            (ColorTags(1, 1, 1), Coding("bt709", full_range=True), ColorTags(1, 1, 1)),
            (ColorTags(1, 1, 1), Coding(), ColorTags(1, 1, 6)),
            (ColorTags(9, 14, 9), Coding(), ColorTags(9, 14, 6)),
        ],
    )
    def test_colours_are_tagged_as_they_are_coded_if_the_source_is_tagged(
        self,
        source: ColorTags,
        coding: Coding,
        written: ColorTags,
        frames: list[Frame],
        tmp_path: Path,
    ) -> None:
        path = write(tmp_path / "out.mp4", frames, replace(INFO, color=source, coding=coding))
        with VideoReader(path) as reader:
            assert reader.info.color == written
            assert reader.info.coding == coding
            corner = next(iter(reader)).image[60:90, 10:70]
        assert np.abs(corner.mean(axis=(0, 1)) - (40, 30, 210)).max() < 5

    TAGS = Tags("2020-01-02T03:04:05.000000Z", "+48.1000-011.5000/", "a drive")

    @pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv"])
    def test_what_the_source_says_of_the_recording_is_kept(
        self, suffix: str, frames: list[Frame], tmp_path: Path
    ) -> None:
        info = replace(INFO, start=Fraction(7), tags=self.TAGS)
        with VideoReader(write(tmp_path / f"out{suffix}", frames, info)) as reader:
            found = reader.info.tags
        assert found.location is not None
        location = [float(item) for item in re.findall(r"[+-][\d.]+", found.location)]
        assert location == [48.1, -11.5]
        assert replace(found, location=None, exporter=None) == replace(self.TAGS, location=None)

    @pytest.mark.parametrize("name", ["ж视频 é.mp4", "a:b.mp4", "100% %03d.mp4", "-o.mp4"])
    def test_any_file_name_works(self, name: str, frames: list[Frame], tmp_path: Path) -> None:
        assert len(read(write(tmp_path / name, frames))) == 12
        assert listing(tmp_path) == [name]


def write_on(writer: VideoWriter, frames: Iterable[Frame]) -> None:
    """Write frames also after an error, as where a thread has the next ones waiting."""
    for frame in frames:
        with suppress(OutputError):
            writer.write(frame)


class TestAllOrNothing:
    def test_no_frames_make_no_file(self, tmp_path: Path) -> None:
        with pytest.raises(VideoError, match=r"out\.mp4: no frames to write"):
            write(tmp_path / "out.mp4", [])
        assert listing(tmp_path) == []

    @pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv"])
    def test_where_no_byte_can_be_written_the_last_call_says_so(
        self, suffix: str, frames: list[Frame], tmp_path: Path
    ) -> None:
        path = tmp_path / f"out{suffix}"
        path.symlink_to("/dev/full")
        full = f"out{suffix}: cannot be written: No space left on device"
        with (
            pytest.raises(OutputError, match=full),
            VideoWriter(path, INFO, FAST, threads=1) as writer,
        ):
            write_on(writer, frames)


class TestRefusals:
    def test_a_gap_that_mp4_cannot_hold(self, frames: list[Frame], tmp_path: Path) -> None:
        late = replace(frames[1], time=frames[1].time + 300 * 86_400)
        with pytest.raises(OutputError, match=r"out\.mp4: cannot hold a pause of 25920000 s"):
            write(tmp_path / "out.mp4", [frames[0], late])
        assert len(read(write(tmp_path / "out.mkv", [frames[0], late]))) == 2

    @pytest.mark.parametrize("name", ["out.avi", "out", "out.mp4.txt"])
    def test_a_suffix_of_no_known_container(self, name: str, tmp_path: Path) -> None:
        with pytest.raises(OutputError, match=r"\.mp4, \.mov, \.mkv"):
            VideoWriter(tmp_path / name, INFO, FAST)


Warnings = Callable[[], list[str]]
Sound = list[tuple[Fraction, bytes]]


def copy(source: Path, target: Path) -> Path:
    with (
        VideoReader(source) as reader,
        VideoWriter(target, reader.info, FAST, whole_audio=True) as writer,
    ):
        for frame in reader:
            writer.write(frame)
    return target


def assert_same(sound: Sound, original: Sound) -> None:
    assert [data for _, data in sound] == [data for _, data in original]
    times = [time for time, _ in sound]
    assert times == pytest.approx([time for time, _ in original], abs=0.001)


@pytest.mark.parametrize(
    ("codec", "suffix"), [("aac", "mp4"), ("ac3", "mov"), ("aac", "mkv"), ("libmp3lame", "mkv")]
)
def test_sound_is_copied_bit_for_bit(
    codec: str, suffix: str, tmp_path: Path, warnings: Warnings
) -> None:
    source = write_clip(tmp_path / "in.mp4", sounds=[codec], sound_seconds=1)
    written = sound_of(copy(source, tmp_path / f"out.{suffix}"))
    original = [packet for packet in sound_of(source) if suffix != "mkv" or packet[0] >= 0]
    assert len(original) > 20
    assert_same(written, original)
    assert warnings() == []


@pytest.mark.parametrize(("codec", "suffix"), [("pcm_mulaw", "avi"), ("pcm_s16le", "mkv")])
@pytest.mark.parametrize("rate", [44_100, 11_000])
def test_sound_that_mp4_cannot_hold_is_encoded(
    codec: str, suffix: str, rate: int, tmp_path: Path, warnings: Warnings
) -> None:
    source = tmp_path / f"in.{suffix}"
    seconds = np.arange(rate) / rate
    beep = np.sin(2 * np.pi * 440 * seconds) * (np.abs(seconds - 0.6) < 0.05)
    with av.open(str(source), "w") as container:
        video = container.add_stream("mpeg4", rate=25)
        sound = container.add_stream(codec, rate=rate, layout="mono")
        assert isinstance(video, av.VideoStream)
        assert isinstance(sound, av.AudioStream)
        video.width, video.height, video.pix_fmt = 64, 48, "yuv420p"
        for _ in range(25):
            image = av.VideoFrame.from_ndarray(np.zeros((48, 64, 3), np.uint8), format="bgr24")
            container.mux(video.encode(image))
        samples = av.AudioFrame.from_ndarray(
            (20_000 * beep).astype(np.int16)[np.newaxis], format="s16", layout="mono"
        )
        samples.sample_rate = rate
        container.mux([*video.encode(None), *sound.encode(samples), *sound.encode(None)])
    target = copy(source, tmp_path / "out.mp4")
    with av.open(str(target)) as container:
        assert container.streams.audio[0].codec_context.name == "aac"
        frames = [(frame, frame.to_ndarray()[0]) for frame in container.decode(audio=0)]
    times = np.concatenate([float(f.time or 0) + np.arange(f.samples) / f.rate for f, _ in frames])
    loud = times[np.abs(np.concatenate([samples for _, samples in frames])) > 0.1]
    assert (loud.min(), loud.max()) == pytest.approx((0.55, 0.65), abs=0.02)
    assert times.max() == pytest.approx(1, abs=0.05)
    assert warnings() == []


def test_damaged_sound_does_not_affect_the_picture(tmp_path: Path, warnings: Warnings) -> None:
    source = write_clip(tmp_path / "in.ts", sounds=["aac"], count=50)
    data = bytearray(source.read_bytes())
    rng = np.random.default_rng(0)
    sound_id = 0x101  # of the second stream, in bits 11 … 23 of each packet of 188 bytes
    for first in range(0, len(data), 5 * 188):
        if int.from_bytes(data[first + 1 : first + 3]) & 0x1FFF == sound_id:
            data[first + 24 : first + 188] = rng.bytes(164)
    source.write_bytes(data)
    target = copy(source, tmp_path / "out.mp4")
    (warning,) = warnings()
    assert warning.startswith(f"{source}: ")
    assert "audio packets dropped: damaged" in warning
    with VideoReader(target) as reader:
        assert len(list(reader)) == 50
    assert sound_of(target)


def test_the_sound_of_a_pipe_is_left_out_with_a_warning(tmp_path: Path, warnings: Warnings) -> None:
    source, pipe = write_clip(tmp_path / "in.ts", sounds=["aac"]), tmp_path / "pipe.ts"
    os.mkfifo(pipe)
    feeder = threading.Thread(target=lambda: pipe.write_bytes(source.read_bytes()))
    feeder.start()
    target = copy(pipe, tmp_path / "out.mp4")
    feeder.join()
    with av.open(str(target)) as container:
        assert container.streams.video[0].frames == 12
        assert not container.streams.audio
    assert warnings() == [f"{pipe}: its audio is dropped: a pipe can be read only once"]

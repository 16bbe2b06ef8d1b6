"""The video writer: what it writes, and that a staged file appears complete or not at all."""

import re
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

import vdet
from clips import draw_frame, read_number, write_clip
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
            (ColorTags(1, 1, 5), Coding(), ColorTags(1, 1, 6)),
            (ColorTags(1, 1, 1), Coding("bt709"), ColorTags(1, 1, 1)),
            (ColorTags(1, 1, 1), Coding(), ColorTags(1, 1, 6)),
            (ColorTags(9, 14, 9), Coding(), ColorTags(9, 14, 6)),
        ],
    )
    @pytest.mark.parametrize("full_range", [False, True])
    def test_colours_are_tagged_as_they_are_coded_if_the_source_is_tagged(
        self,
        source: ColorTags,
        coding: Coding,
        written: ColorTags,
        *,
        full_range: bool,
        frames: list[Frame],
        tmp_path: Path,
    ) -> None:
        coding = replace(coding, full_range=full_range)
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

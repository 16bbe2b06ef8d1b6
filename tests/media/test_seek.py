"""A part of a video has the frames of the whole, wherever decoding begins."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from clips import joined, write_clip
from vdet.media import Frame
from vdet.media.demux import Damage, Decoder
from vdet.media.reader import VideoReader

GOPS: dict[str, Any] = {"options": {"g": "10", "bf": "2"}, "count": 60}
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
    "intra refresh": (
        "mp4",
        {"options": {"g": "20", "bf": "0", "x264-params": "intra-refresh=1"}},
    ),
    "intra refresh, b-frames": (
        "mkv",
        {"options": {"g": "20", "x264-params": "intra-refresh=1"}},
    ),
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


def read(path: Path, start: Fraction | None = None) -> list[Frame]:
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
    whole = read(path)
    for number in (1, 9, 10, 11, 38, 40, 55, 59):
        start = whole[number].time - whole[0].time
        decoded.clear()
        assert_part(read(path, start), whole, start)
        assert len(decoded) < 60 - number + 35


@pytest.mark.parametrize("name", NOT_SURE)
def test_where_frames_cannot_be_counted_all_are_decoded(
    name: str, tmp_path: Path, decoded: list[None]
) -> None:
    suffix, spec = NOT_SURE[name]
    path = write_clip(tmp_path / f"clip.{suffix}", **GOPS | spec)
    whole = read(path)
    decoded.clear()
    start = Fraction(2)
    assert_part(read(path, start), whole, start)
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
    assert_part(read(path, Fraction(4)), read(path), Fraction(4))


@pytest.mark.parametrize("suffix", ["mp4", "mkv"])
def test_a_start_beyond_the_end_gives_no_frame_and_the_length(suffix: str, tmp_path: Path) -> None:
    path = write_clip(tmp_path / f"clip.{suffix}", **GOPS)
    with VideoReader(path, start=Fraction(10**13)) as reader:
        assert list(reader) == []
        assert reader.length == pytest.approx(Fraction(60, 25), abs=0.002)

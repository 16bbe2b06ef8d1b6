"""What a video file is, and what of it a written video keeps and loses."""

import os
from fractions import Fraction
from pathlib import Path

import av
import pytest

from clips import write_clip
from media.test_reader import write_hdr
from vdet.errors import VideoError
from vdet.media.inspection import inspect_video

FRAMES = 3


def test_a_plain_clip_loses_nothing(tmp_path: Path) -> None:
    report = inspect_video(write_clip(tmp_path / "a.mp4", sounds=["aac"], matrix=1), FRAMES)
    assert (report.codec, report.pixels, report.bits) == ("h264", "yuv420p", 8)
    assert report.colors == {"matrix": "BT709", "range": "limited"}
    assert report.lost == ()
    assert report.kept == ("every frame at its time", "sound 1 (aac), as it is")
    assert [image.shape for image in report.images] == [(96, 160, 3)] * FRAMES


def test_a_clip_shorter_than_asked_for_gives_the_frames_that_it_has(tmp_path: Path) -> None:
    assert len(inspect_video(write_clip(tmp_path / "a.mp4", count=2), FRAMES).images) == 2


@pytest.mark.parametrize(
    ("spec", "lost"),
    [
        ({"size": (161, 97), "codec": "ffv1", "pix_fmt": "yuv420p"}, "written as 162×98"),
        ({"codec": "ffv1", "pix_fmt": "yuv444p"}, "written with half of it (4:2:0)"),
        ({"codec": "ffv1", "pix_fmt": "bgra"}, "transparency"),
        ({"codec": "ffv1", "pix_fmt": "yuv420p10le"}, "10 bits a colour value: written with 8"),
    ],
)
def test_what_pictures_lose_is_told(tmp_path: Path, spec: dict[str, object], lost: str) -> None:
    report = inspect_video(write_clip(tmp_path / "a.mkv", **spec), FRAMES)  # type: ignore[arg-type]
    assert any(lost in each for each in report.lost), report.lost


def test_grey_video_has_no_colour_to_lose(tmp_path: Path) -> None:
    path = write_clip(tmp_path / "a.mkv", codec="ffv1", pix_fmt="gray")
    assert inspect_video(path, FRAMES).lost == ()


def test_hdr_is_told(tmp_path: Path) -> None:
    report = inspect_video(write_hdr(tmp_path / "hdr.mkv", 16, 500), FRAMES)
    assert report.colors["transfer"] == "PQ"
    assert "HDR (PQ): written as standard range (BT.709)" in report.lost


def test_other_streams_and_tags_are_told(tmp_path: Path) -> None:
    source = write_clip(tmp_path / "plain.mp4")
    path = tmp_path / "more.mkv"
    with av.open(str(source)) as original, av.open(str(path), "w") as target:
        target.metadata["artist"] = "a driver"
        target.metadata["title"] = "a drive"
        copies = [target.add_stream_from_template(original.streams.video[0]) for _ in range(2)]
        for packet in list(original.demux()):
            for copy in copies:
                if packet.size:
                    packet.stream = copy
                    target.mux(packet)
    report = inspect_video(path, FRAMES)
    assert "video streams other than the first: 1" in report.lost
    assert "title" in report.kept
    assert any("ARTIST" in each.upper() for each in report.lost)
    assert not any("title" in each.lower() for each in report.lost)


def test_times_that_vary_give_two_rates(tmp_path: Path) -> None:
    times = [Fraction(n, 25) for n in (0, 1, 2, 3, 9, 10, 11, 12, 20, 21)]
    report = inspect_video(write_clip(tmp_path / "a.mp4", times=times), FRAMES)
    assert report.guessed_rate is not None
    assert report.info.rate < report.guessed_rate


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no FIFOs here")
def test_a_pipe_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(VideoError, match="can be read only once"):
        inspect_video(tmp_path / "pipe", FRAMES)

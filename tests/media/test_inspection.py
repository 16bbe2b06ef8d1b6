"""What a video file is, and what of it a written video loses."""

import os
from pathlib import Path

import pytest

from clips import write_clip
from media.test_reader import write_hdr
from vdet.errors import VideoError
from vdet.media.inspection import inspect_video


def test_a_plain_clip_loses_nothing(tmp_path: Path) -> None:
    report = inspect_video(write_clip(tmp_path / "a.mp4", sounds=["aac"]), 3)
    assert (report.codec, report.pixels, report.sounds) == ("h264", "yuv420p", ("aac, 48000 Hz",))
    assert report.lost == ()
    assert [image.shape for image in report.images] == [(96, 160, 3)] * 3


def test_what_is_lost_is_named(tmp_path: Path) -> None:
    report = inspect_video(write_hdr(tmp_path / "hdr.mkv", 16, 500), 3)
    assert report.lost == ("HDR (PQ)", "10 bits a colour value")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no FIFOs here")
def test_a_pipe_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(VideoError, match="can be read only once"):
        inspect_video(tmp_path / "pipe", 3)

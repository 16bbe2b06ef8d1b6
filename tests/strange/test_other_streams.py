"""Files with covers, subtitles, several sizes, or frames too small or too wide to be searched."""

from fractions import Fraction
from pathlib import Path

import av
import pytest
from av.stream import Disposition

from clips import joined, write_clip
from strange.conftest import Process, assert_whole


def test_a_cover_picture_is_not_the_video(tmp_path: Path, process: Process) -> None:
    path = tmp_path / "cover.mp4"
    source = write_clip(tmp_path / "plain.mp4", sounds=["aac"])
    with av.open(str(source)) as original, av.open(str(path), "w") as target:
        cover = target.add_stream("png", rate=1)
        assert isinstance(cover, av.VideoStream)
        cover.width, cover.height, cover.pix_fmt = 32, 32, "rgb24"
        cover.disposition = Disposition.attached_pic
        copies = {s.index: target.add_stream_from_template(s) for s in original.streams}
        target.mux(cover.encode(av.VideoFrame(32, 32, "rgb24")) + cover.encode(None))
        for packet in original.demux():
            if packet.size:
                packet.stream = copies[packet.stream.index]
                target.mux(packet)
    shown = process(path)
    assert_whole(shown, list(range(12)))
    assert list(shown.sounds) == ["1 aac"]
    assert shown.warnings == []


def test_subtitles_are_ignored(tmp_path: Path, process: Process) -> None:
    texts = tmp_path / "texts.srt"
    texts.write_text("1\n00:00:00,000 --> 00:00:00,300\nhello\n")
    source, path = write_clip(tmp_path / "plain.mkv"), tmp_path / "subtitled.mkv"
    with (
        av.open(str(source)) as original,
        av.open(str(texts)) as text,
        av.open(str(path), "w") as target,
    ):
        copies = [target.add_stream_from_template(item.streams[0]) for item in (original, text)]
        for item, copy in zip((original, text), copies, strict=True):
            for packet in item.demux():
                if packet.size:
                    packet.stream = copy
                    target.mux(packet)
    with av.open(str(path)) as container:
        assert len(container.streams.subtitles) == 1
    shown = process(path)
    assert_whole(shown, list(range(12)))
    assert shown.warnings == []


def test_frames_that_change_size_are_scaled_to_the_first_with_a_warning(
    tmp_path: Path, process: Process
) -> None:
    small = write_clip(tmp_path / "small.h264", count=6)
    large = write_clip(tmp_path / "large.h264", count=9, size=(320, 192))
    shown = process(joined(tmp_path / "both.h264", small, large))
    assert {image.shape for image in shown.images} == {(96, 160, 3)}
    assert_whole(shown, [*range(6), *range(9)])
    (warning,) = shown.warnings
    assert "both.h264: frames of other sizes are scaled to the first" in warning


@pytest.mark.parametrize("size", [(1, 1), (2, 2), (2, 200), (200, 2)])
def test_frames_too_small_for_any_window_pass_with_a_warning(
    size: tuple[int, int], tmp_path: Path, process: Process
) -> None:
    tracks, stages = tmp_path / "t.csv", tmp_path / "stages"
    wanted = ("--tracks", str(tracks), "--stages", str(stages), "--at", "0")
    clip = write_clip(tmp_path / "tiny.mkv", size=size, count=5, codec="ffv1", pix_fmt="bgr0")
    shown = process(clip, "-c", "svm", *wanted)
    width, height = size
    shape = (height + height % 2, width + width % 2, 3)
    assert [image.shape for image in shown.images] == [shape] * 5
    assert shown.times == [Fraction(index, 25) for index in range(5)]
    assert len(tracks.read_text().splitlines()) == 1, "the heading"
    assert [path.name for path in stages.iterdir()] == ["1-boxes.png"]
    (warning,) = [warning for warning in shown.warnings if "horizon" not in warning]
    assert "tiny.mkv: no vehicles can be detected: no search window fits into" in warning
    assert f"{width}×{height}" in warning

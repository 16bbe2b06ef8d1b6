"""`vdet detect-video`."""

import json
import shutil
import struct
from fractions import Fraction
from pathlib import Path

import pytest

from clips import write_clip as write_foreign
from conftest import Run
from quick import QUICK_OPTIONS
from vdet.media.reader import VideoReader


def _times(path: Path) -> list[Fraction]:
    with VideoReader(path) as reader:
        return [frame.time for frame in reader]


def test_without_an_output_the_video_is_written_beside_its_source(
    run: Run, clip_path: Path, model_path: Path, tmp_path: Path
) -> None:
    source = tmp_path / "gate.mp4"
    shutil.copy(clip_path, source)
    options = (source, "--frames", "3", "--model", model_path, *QUICK_OPTIONS)
    result = run("detect-video", *options, code=0)
    assert f"{tmp_path / 'gate.vdet.mp4'}: written" in result.err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["gate.mp4", "gate.vdet.mp4"]
    again = run("detect-video", *options)
    assert (again.code, "gate.vdet.mp4: already exists; use --overwrite" in again.err) == (1, True)
    run("detect-video", *options, "--overwrite", code=0)


def test_stride_is_the_setting_of_the_detector(run: Run, clip_path: Path, model_path: Path) -> None:
    found = []
    for stride in (("--stride", "5"), ("--set", "detector.stride=5"), ()):
        options = ("--no-video", "--tracks", "-", "--model", model_path, *QUICK_OPTIONS, *stride)
        found.append(run("detect-video", clip_path, *options, code=0).out)
    assert found[0] == found[1] != found[2]


def test_a_part_of_the_video(run: Run, clip_path: Path, model_path: Path, tmp_path: Path) -> None:
    tracks = tmp_path / "t.jsonl"
    options = ("--start", "0:00.4", "--end", "0.8", "--tracks", tracks, "--model", model_path)
    run("detect-video", clip_path, tmp_path / "out.mp4", *options, *QUICK_OPTIONS, code=0)
    frames = [json.loads(line)["frame"] for line in tracks.read_text().splitlines()]
    assert frames == list(range(10, 20))
    assert _times(tmp_path / "out.mp4") == [Fraction(i, 25) for i in range(10)]


@pytest.mark.parametrize("more", [(), ("--overwrite",), ("--overwrite", "--frames", "1")])
def test_a_video_of_another_program_is_kept_and_the_message_shows_the_command_for_several(
    run: Run, tmp_path: Path, more: tuple[str, ...]
) -> None:
    clips = [write_foreign(tmp_path / f"{name} 1.mp4") for name in "abc"]
    before = [clip.read_bytes() for clip in clips]
    for several in (clips[:2], clips):
        result = run("detect-video", *several, *more)
        assert result.code == 2
        dots = " …" if len(several) > 2 else ""
        assert f"vdet detect-video '{clips[0]}' '{clips[1]}'{dots} -d found" in result.err
    assert [clip.read_bytes() for clip in clips] == before
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv"])
def test_what_vdet_wrote_and_what_is_no_video_is_replaced(
    run: Run, clip_path: Path, tmp_path: Path, suffix: str
) -> None:
    out = tmp_path / f"out{suffix}"
    out.write_bytes(b"This is no video.")
    for frames in (2, 3):
        options = ("--overwrite", "--frames", str(frames))
        run("detect-video", clip_path, out, *options, code=0)
        assert len(_times(out)) == frames


def test_only_reading_decides_whether_a_time_is_beyond_the_end(run: Run, tmp_path: Path) -> None:
    clip = write_foreign(tmp_path / "clip.mkv", count=250, options={"g": "10"})
    out = tmp_path / "o.mp4"
    declared = struct.pack(">d", 10_000), struct.pack(">d", 333)  # ms
    content = clip.read_bytes().replace(*declared).replace(b"00:00:10.000", b"00:00:00.333")
    clip.write_bytes(content)
    run("detect-video", clip, out, "--start", "9.8", code=0)
    assert len(_times(out)) == 5
    result = run("detect-video", clip, tmp_path / "p.mp4", "--start", "20", code=1)
    assert f"{clip}: 20.00 s is beyond its end; it ends at 10.00 s" in result.err

"""Damaged and malicious videos: each run ends in time, without an error or with one line of it."""

import struct
from pathlib import Path
from typing import Any

from clips import write_clip
from hostile.mutations import mutated
from hostile.trials import Trial, try_files
from quick import FEW_OPTIONS

CLIPS: dict[str, dict[str, Any]] = {
    "mp4": {"sounds": ["aac"], "movflags": "+faststart"},
    "mkv": {"sounds": ["libopus"]},
    "webm": {"codec": "libvpx-vp9", "options": {"deadline": "realtime"}, "sounds": ["libopus"]},
    "avi": {"codec": "mpeg4", "sounds": ["libmp3lame"]},
    "ts": {"sounds": ["aac"]},
    "gif": {"codec": "gif", "pix_fmt": "rgb8"},
}
EACH = 20


def outcomes(folder: Path, contents: dict[str, bytes]) -> list[Trial]:
    """Run the program on files of these contents; only whole outputs are written."""
    trials = try_files(
        folder,
        contents,
        lambda path, out: ["-q", "detect-video", path, out / f"{path.name}.mp4", *FEW_OPTIONS],
    )
    written = {f"{name}.mp4" for name, t in zip(contents, trials, strict=True) if t.code == 0}
    assert {path.name for path in (folder / "out").iterdir()} == written
    return trials


def test_damaged_videos_end_well_or_with_one_line_of_error(tmp_path: Path) -> None:
    contents = {}
    for kind, spec in CLIPS.items():
        good = write_clip(tmp_path / f"good.{kind}", count=8, size=(96, 64), **spec)
        for number, data in enumerate(mutated(good.read_bytes(), seed=2024, count=EACH)):
            contents[f"{number:03d}.{kind}"] = data
    codes = [trial.code for trial in outcomes(tmp_path, contents)]
    assert len(codes) == EACH * len(CLIPS)
    assert 10 < sum(code == 1 for code in codes) < 110


def test_enormous_frames_are_refused_before_memory_is_set_aside(tmp_path: Path) -> None:
    data = bytearray(write_clip(tmp_path / "good.gif", codec="gif", pix_fmt="rgb8").read_bytes())
    contents = {}
    for width, height in ((65_535, 65_535), (65_535, 500), (500, 65_535), (16_000, 8_000)):
        data[6:10] = struct.pack("<HH", width, height)
        contents[f"{width}×{height}.gif"] = bytes(data)
    assert all("37 million pixels" in trial.err for trial in outcomes(tmp_path, contents))


def test_a_playlist_opens_no_other_file(tmp_path: Path) -> None:
    secret = write_clip(tmp_path / "secret.ts")
    playlist = f"#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n{secret}\n#EXT-X-ENDLIST\n".encode()
    contents = {
        "list.m3u8": playlist,
        "list.mp4": playlist,
        "parts.mp4": f"ffconcat version 1.0\nfile {secret.name}\n".encode(),
        "text.mp4": b"\x1b[2J\x1b[31mnothing to see\n" * 200,
    }
    assert all("is not a video" in trial.err for trial in outcomes(tmp_path, contents))

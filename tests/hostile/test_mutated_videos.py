"""Damaged and malicious videos: each run ends in time, without an error or with one line of it."""

import json
import os
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from clips import write_clip
from hostile.mutations import mutated
from quick import FEW_OPTIONS

CLIPS: dict[str, dict[str, Any]] = {
    "mp4": {"sounds": ["aac"], "movflags": "+faststart"},
    "mkv": {"sounds": ["libopus"]},
    "webm": {"codec": "libvpx-vp9", "options": {"deadline": "realtime"}, "sounds": ["libopus"]},
    "avi": {"codec": "mpeg4", "sounds": ["libmp3lame"]},
    "ts": {"sounds": ["aac"]},
    "gif": {"codec": "gif", "pix_fmt": "rgb8"},
}
EACH = 50
SECONDS = 300.0  # for one file, on a very busy machine; usually 0.03 s
MEMORY = 1_000_000_000
WORKER = Path(__file__).with_name("video_worker.py")


class Runs:
    """Runs the program on the files of a folder, in one other process, and checks the outcomes."""

    def __init__(self, folder: Path) -> None:
        self.sources = folder / "in"
        self.outputs = folder / "out"
        self.elsewhere = folder / "elsewhere"
        for each in (self.sources, self.outputs, self.elsewhere):
            each.mkdir()

    def add(self, name: str, data: bytes) -> None:
        (self.sources / name).write_bytes(data)

    def outcomes(self) -> dict[str, tuple[int, str]]:
        """Return exit code and messages for each file, after the checks that hold for all."""
        before = {path.name: path.read_bytes() for path in self.sources.iterdir()}
        done = subprocess.run(
            [sys.executable, WORKER, self.sources, self.outputs, str(SECONDS), *FEW_OPTIONS],
            capture_output=True,
            text=True,
            cwd=self.elsewhere,
            env={**os.environ, "HOME": str(self.elsewhere), "TMPDIR": str(self.elsewhere)},
            check=False,
        )
        reports = [json.loads(line) for line in done.stdout.splitlines()]
        assert done.returncode == 0, f"{reports[-1]['source']}: {done.stderr[-2000:]}"
        ended = {each["source"]: each for each in reports if each["code"] is not None}
        assert ended.keys() == before.keys()
        for each in ended.values():
            self._check(each["source"], each["code"], each["said"])
            assert each["peak"] < MEMORY, each["source"]
        written = {f"{Path(name).stem}.mp4" for name, each in ended.items() if each["code"] == 0}
        assert {path.name for path in self.outputs.iterdir()} == written
        assert {path.name: path.read_bytes() for path in self.sources.iterdir()} == before
        assert list(self.elsewhere.iterdir()) == []
        return {name: (each["code"], each["said"]) for name, each in ended.items()}

    @staticmethod
    def _check(name: str, code: int, said: str) -> None:
        lines = [line for line in said.splitlines() if not line.startswith("vdet: warning: ")]
        assert code in {0, 1}, f"{name}: {said}"
        assert len(lines) == 1, f"{name}: {said}"
        assert lines[0].startswith("vdet: ") == (code == 1), f"{name}: {said}"
        assert name in lines[0], f"{name}: {said}"


@pytest.fixture
def runs(tmp_path: Path) -> Runs:
    return Runs(tmp_path)


@pytest.mark.parametrize("kind", CLIPS)
def test_each_run_on_a_damaged_file_ends_well_or_with_one_line_of_error(
    kind: str, runs: Runs, tmp_path: Path
) -> None:
    good = write_clip(tmp_path / f"good.{kind}", count=8, size=(96, 64), **CLIPS[kind])
    for number, data in enumerate(mutated(good.read_bytes(), seed=2024, count=EACH)):
        runs.add(f"{number:03d}.{kind}", data)
    codes = [code for code, _ in runs.outcomes().values()]
    assert len(codes) == EACH
    assert 0 < sum(codes) < EACH, "all alike: the damage is too little or too much to say anything"


def test_enormous_frames_are_refused_before_memory_is_set_aside(runs: Runs, tmp_path: Path) -> None:
    data = bytearray(write_clip(tmp_path / "good.gif", codec="gif", pix_fmt="rgb8").read_bytes())
    for width, height in ((65_535, 65_535), (65_535, 500), (500, 65_535), (16_000, 8_000)):
        data[6:10] = struct.pack("<HH", width, height)
        runs.add(f"{width}×{height}.gif", bytes(data))
    for code, said in runs.outcomes().values():
        assert code == 1
        assert "37 million pixels" in said


def test_a_playlist_opens_no_other_file(runs: Runs, tmp_path: Path) -> None:
    secret = write_clip(tmp_path / "secret.ts")
    head = "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n"
    runs.add("list.m3u8", f"{head}{secret}\n#EXT-X-ENDLIST\n".encode())
    runs.add("list.mp4", f"{head}{secret}\n#EXT-X-ENDLIST\n".encode())
    runs.add("parts.mp4", f"ffconcat version 1.0\nfile {secret.name}\n".encode())
    runs.add("text.mp4", b"\x1b[2J\x1b[31mnothing to see\n" * 200)
    for code, said in runs.outcomes().values():
        assert code == 1
        assert "is not a video" in said

"""Damage in a file: the rest is processed, the loss is reported, and too much of it is an error."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from clips import read_number, write_clip
from conftest import Run
from strange.conftest import Process

COUNT = 40
# Every frame is a key frame, so that damage does not spread.
KINDS: dict[str, dict[str, Any]] = {
    "mp4": {"movflags": "+faststart", "options": {"g": "1"}},
    "ts": {"options": {"g": "1"}, "size": (640, 384)},
    "mkv": {"options": {"g": "1"}},
    "avi": {"codec": "mpeg4", "options": {"g": "1", "q": "2"}},
    "webm": {"codec": "libvpx-vp9", "options": {"g": "1", "deadline": "realtime"}},
}
NOISE = {"mp4": (40, 0), "ts": (192, 376), "mkv": (40, 0), "avi": (40, 0), "webm": (6, 0)}
"""Range of bytes in the packet of a frame that become noise; 0 for the end of the packet.

A transport stream consists of cells of 188 bytes, each with a header: it is the second cell.
"""


def packets_of(path: Path) -> list[tuple[int, int]]:
    """Return position and size of each packet, bytes."""
    with av.open(str(path)) as container:
        packets = [packet for packet in container.demux(video=0) if packet.size]
    return [(packet.pos or 0, packet.size) for packet in packets]


def damaged(folder: Path, suffix: str, frames: list[int]) -> Path:
    """Write a clip in which these frames are damaged."""
    path = write_clip(folder / f"damaged.{suffix}", count=COUNT, **KINDS[suffix])
    data = bytearray(path.read_bytes())
    rng = np.random.default_rng(0)
    places = packets_of(path)
    for frame in frames:
        position, size = places[frame]
        begin, end = NOISE[suffix]
        first, last = position + begin, position + (end or size)
        data[first:last] = rng.bytes(last - first)
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("suffix", KINDS)
def test_a_little_damage_is_a_warning_and_the_rest_is_processed(
    suffix: str, tmp_path: Path, process: Process
) -> None:
    source = damaged(tmp_path, suffix, [22, 33])
    shown = process(source)
    assert all(earlier < later for earlier, later in pairwise(shown.times))
    found = {round(time * 25): image for time, image in zip(shown.times, shown.images, strict=True)}
    whole = set(range(COUNT)) - {22, 33}
    assert whole <= found.keys()
    assert {number: read_number(found[number]) for number in whole} == {n: n for n in whole}
    (warning,) = shown.warnings
    assert f"damaged.{suffix}: 2 of 40 frames damaged or lost" in warning


@pytest.mark.parametrize("suffix", KINDS)
def test_too_much_damage_is_an_error_and_nothing_is_written(
    suffix: str, run: Run, tmp_path: Path
) -> None:
    source = damaged(tmp_path, suffix, [11, 22, 33, 34])
    (tmp_path / "out").mkdir()
    out = tmp_path / "out" / "out.mp4"
    result = run("detect-video", source, out, "--tracks", out.with_suffix(".csv"))
    assert result.code == 1
    assert result.err.count("\n") == 1, result.err
    assert (
        f"damaged.{suffix}: 4 of 40 frames damaged or lost, more than input.max_damaged: "
        "0.05 allows; raise it" in result.err
    )
    assert not list(out.parent.iterdir())


def test_damage_after_the_last_frame_read_does_not_count(tmp_path: Path, process: Process) -> None:
    source = damaged(tmp_path, "mp4", [31, 32, 33, 34])
    shown = process(source, "--frames", "25")
    assert [read_number(image) for image in shown.images] == list(range(25))
    assert shown.warnings == []

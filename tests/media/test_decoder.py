"""Where there is damage, every frame that can be decoded is shown, and none twice."""

from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from clips import joined
from vdet.config.schema import InputSettings
from vdet.media import VideoReader

Number = Callable[[NDArray[np.uint8]], int]
Writer = Callable[..., Path]
SHAPE = {"count": 60, "size": (640, 384), "movflags": "+faststart"}
GOP = SHAPE | {"options": {"g": "10", "bf": "2"}}
OPEN_GOP = SHAPE | {"options": {"g": "10", "bf": "2", "x264-params": "open-gop=1"}}


def damage(path: Path, packet: int = 33) -> Path:
    """Write noise into the middle of a packet."""
    with av.open(str(path)) as container:
        positions = [each.pos or 0 for each in container.demux(video=0) if each.size]
    data = bytearray(path.read_bytes())
    middle = (positions[packet] + positions[packet + 1]) // 2
    data[middle : middle + 40] = np.random.default_rng(0).bytes(40)
    path.write_bytes(data)
    return path


def read(path: Path, read_number: Number, *, threads: int) -> tuple[list[int], list[Fraction], int]:
    """Return the frames' numbers and times, and how many were damaged or lost."""
    with VideoReader(path, threads=threads, settings=InputSettings(max_damaged=1)) as reader:
        frames = list(reader)
    numbers = [read_number(frame.image) for frame in frames]
    return numbers, [frame.time for frame in frames], reader.damaged


@pytest.mark.parametrize("threads", [1, 4])
@pytest.mark.parametrize("suffix", ["mp4", "mkv", "h264"])  # the last has no times
@pytest.mark.parametrize("spec", [GOP, OPEN_GOP], ids=["closed", "open"])
def test_every_frame_is_shown_once(
    spec: dict[str, object],
    suffix: str,
    threads: int,
    *,
    tmp_path: Path,
    write_clip: Writer,
    read_number: Number,
) -> None:
    path = damage(write_clip(tmp_path / f"damaged.{suffix}", **spec))
    numbers, times, damaged = read(path, read_number, threads=threads)
    assert damaged > 0
    assert numbers[:30] == list(range(30))
    assert numbers[-9:] == list(range(51, 60))
    assert all(earlier < later for earlier, later in pairwise(times))
    assert 60 - damaged <= len(times) <= 60
    assert times[-1] == times[0] + Fraction(len(times) - 1 if suffix == "h264" else 59, 25)


@pytest.mark.parametrize("threads", [1, 4])
def test_a_damaged_recording_joined_to_another_gives_both(
    threads: int, tmp_path: Path, write_clip: Writer, read_number: Number
) -> None:
    first = damage(write_clip(tmp_path / "first.ts", **GOP))
    path = joined(tmp_path / "joined.ts", first, write_clip(tmp_path / "second.ts", **GOP))
    numbers, _, damaged = read(path, read_number, threads=threads)
    assert numbers[-60:] == list(range(60))
    assert len(numbers) >= 120 - damaged
    assert 0 < damaged < 20

"""Recordings whose clock restarts: all frames and all sound, on one continuous time line."""

from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from clips import joined, read_number, sound_of, write_clip
from vdet.config.schema import OutputSettings
from vdet.media.reader import VideoReader
from vdet.media.writer import VideoWriter

Warnings = Callable[[], list[str]]
KINDS: dict[str, dict[str, Any]] = {
    "ts": {"codec": "libx264", "sounds": ["aac"], "options": {"g": "10", "bf": "2"}},
    "vob": {"codec": "mpeg2video", "sounds": ["mp2"], "options": {"g": "10", "bf": "2"}},
}
COUNT = 30
PERIOD = Fraction(1, 25)
PAUSE = Fraction(1, 5)  # at most, from part to part


def copy(source: Path) -> tuple[list[int], list[Fraction], Path]:
    """Copy a clip; return the numbers of its frames, their times, and the copy."""
    target = source.with_name("copy.mkv")
    with (
        VideoReader(source) as reader,
        VideoWriter(target, reader.info, OutputSettings(preset="ultrafast")) as writer,
    ):
        frames = list(reader)
        for frame in frames:
            writer.write(frame)
        assert reader.damaged == 0
    numbers = [read_number(frame.image) for frame in frames]
    return numbers, [frame.time - frames[0].time for frame in frames], target


def sound(path: Path) -> list[tuple[Fraction, bytes]]:
    """Return the packets; those of AAC in a transport stream have a header."""
    header = 7 if path.suffix == ".ts" else 0
    return [(time, data[header:]) for time, data in sound_of(path)]


def part(folder: Path, kind: str, begin: int = 0) -> Path:
    name = f"{begin}.{kind}"
    return write_clip(folder / name, count=COUNT, begin=Fraction(begin), **KINDS[kind])


@pytest.mark.parametrize(
    ("kind", "begins"),
    [
        ("ts", [0, 0]),
        ("vob", [0, 0]),
        ("ts", [0, 100, 0]),  # goes forth and back
        ("ts", [1000, 0]),  # FFmpeg takes it for a clock of 33 bits that overflows
    ],
)
def test_all_frames_and_all_sound_follow_one_another(
    kind: str, begins: list[int], *, tmp_path: Path, warnings: Warnings
) -> None:
    parts = [part(tmp_path, kind, begin) for begin in begins]
    source = joined(tmp_path / f"joined.{kind}", *parts)
    numbers, times, target = copy(source)
    assert numbers == list(range(COUNT)) * len(parts)
    steps = [later - earlier for earlier, later in pairwise(times)]
    within = [step for number, step in enumerate(steps, start=1) if number % COUNT]
    assert set(within) == {PERIOD}
    assert all(PERIOD <= step <= PAUSE for step in steps)

    heard = sound(target)
    expected = [data for part in parts for _, data in sound(part)]
    first = expected.index(heard[0][1])  # mkv holds none from before the first frame
    assert first <= 2
    assert [data for _, data in heard] == expected[first:]
    gaps = [later - earlier for (earlier, _), (later, _) in pairwise(heard)]
    assert all(0 < gap <= PAUSE for gap in gaps)
    count = len(parts) - 1
    assert warnings() == [f"{source}: its clock restarts {count}×; the parts follow one another"]


def test_picture_and_sound_of_each_part_stay_in_step(tmp_path: Path) -> None:
    clip = part(tmp_path, "ts")
    _, times, target = copy(joined(tmp_path / "joined.ts", clip, clip))
    alone = sound(clip)
    second = sound(target)[-len(alone) :]
    assert float(second[0][0] - times[COUNT]) == pytest.approx(float(alone[0][0]), abs=0.002)


def test_a_pause_of_the_pictures_is_kept_while_the_sound_goes_on(
    tmp_path: Path, warnings: Warnings
) -> None:
    times = [Fraction(index, 25) + (12 if index >= 20 else 0) for index in range(COUNT)]
    clip = write_clip(tmp_path / "pause.ts", times=times, **KINDS["ts"])
    numbers, found, _ = copy(clip)
    assert numbers == list(range(COUNT))
    assert found == times
    assert not any("clock" in warning for warning in warnings())

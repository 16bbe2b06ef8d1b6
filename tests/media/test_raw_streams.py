"""The frame rate of streams without a container, which have no times."""

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from clips import write_clip
from vdet.config.schema import InputSettings
from vdet.errors import VideoError
from vdet.media.reader import VideoReader

SLOW = Fraction(25, 2)
CODECS = {"h264": "libx264", "hevc": "libx265", "m2v": "mpeg2video", "h263": "h263"}
"""Streams that state their rate."""
RATES = {"m2v": Fraction(24), "h263": Fraction(30_000, 1001)}  # no others, or few


def read(path: Path, rate: float | None = None) -> tuple[list[Fraction], Fraction, Fraction | None]:
    """Return the times of the frames, the rate, and the length."""
    with VideoReader(path, settings=InputSettings(frame_rate=rate)) as reader:
        times = [frame.time for frame in reader]
        return times, reader.info.rate, reader.length


@pytest.mark.parametrize("suffix", CODECS)
def test_the_rate_is_that_of_the_stream(
    suffix: str, tmp_path: Path, warnings: Callable[[], list[str]]
) -> None:
    rate = RATES.get(suffix, SLOW)
    spec: dict[str, Any] = {"codec": CODECS[suffix], "rate": rate, "size": (176, 144)}
    path = write_clip(tmp_path / f"clip.{suffix}", count=30, **spec)
    assert read(path) == ([number / rate for number in range(30)], rate, 30 / rate)
    assert read(path, 10)[1] == 10
    assert warnings() == []
    clip = write_clip(tmp_path / "clip.mp4", count=2)
    with pytest.raises(VideoError, match="has a frame rate of its own; remove input"):
        read(clip, 10)


@pytest.mark.parametrize(
    ("given", "rate"), [(None, Fraction(25)), (12.5, SLOW), (50, Fraction(50))]
)
@pytest.mark.parametrize(
    ("suffix", "spec"),
    [
        ("mjpeg", {"codec": "mjpeg", "pix_fmt": "yuvj420p", "rate": SLOW}),
        *(
            ("h264", {"codec": "libx264", "rate": unit})
            for unit in map(Fraction, ("600", "1000", "1/25"))
        ),
    ],
)
def test_a_stream_without_a_usual_rate_has_that_of_the_settings(
    suffix: str,
    spec: dict[str, Any],
    given: float | None,
    rate: Fraction,
    tmp_path: Path,
    warnings: Callable[[], list[str]],
) -> None:
    path = write_clip(tmp_path / f"clip.{suffix}", count=30, **spec)
    assert read(path, given) == ([number / rate for number in range(30)], rate, 30 / rate)
    assumed = f"{path}: 25 frames per second are assumed; set input.frame_rate"
    assert warnings() == [assumed] * (given is None)

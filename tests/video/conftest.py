"""Clips drawn in code: every frame carries its number, so order and identity survive coding."""

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from numpy.typing import NDArray

Image = NDArray[np.uint8]
BITS = 6
RED = (40, 30, 210)  # BGR


def _draw_frame(number: int, width: int, height: int) -> Image:
    """The number in black and white bars above, a red corner below on the left."""
    image = np.full((height, width, 3), 110, np.uint8)
    for bit in range(BITS):
        columns = slice(bit * width // BITS, (bit + 1) * width // BITS)
        image[: height // 2, columns] = 235 if number >> bit & 1 else 20
    image[height // 2 :, : width // 2] = RED
    return image


def _read_number(image: Image) -> int:
    height, width = image.shape[:2]
    row = image[height // 8 : 3 * height // 8].mean(axis=(0, 2))
    middles = [(2 * bit + 1) * width // (2 * BITS) for bit in range(BITS)]
    return sum(1 << bit for bit, x in enumerate(middles) if row[x - 2 : x + 3].mean() > 127)


def _add_sound(container: av.container.OutputContainer, codec: str) -> av.AudioStream:
    stream = container.add_stream(codec, rate=48000)
    assert isinstance(stream, av.AudioStream)
    stream.codec_context.layout = "mono"
    return stream


def _tone(stream: av.AudioStream, seconds: float) -> "list[av.Packet[Any]]":
    size = stream.codec_context.frame_size or 1024
    packets: list[av.Packet[Any]] = []
    resampler = av.AudioResampler(format=stream.codec_context.format, layout="mono", rate=48000)
    for first in range(0, math.ceil(seconds * 48000), size):
        wave = 0.3 * np.sin(np.arange(first, first + size) * 2 * np.pi * 440 / 48000)
        frame = av.AudioFrame.from_ndarray(
            (wave[None] * 32767).astype(np.int16), format="s16", layout="mono"
        )
        frame.sample_rate, frame.pts, frame.time_base = 48000, first, Fraction(1, 48000)
        for resampled in resampler.resample(frame):
            packets += stream.encode(resampled)
    return packets + stream.encode(None)


def _tag_colors(stream: av.VideoStream, full_range: bool, matrix: int | None) -> dict[str, int]:
    """Tag the stream; return how to convert a frame so that the tags are true."""
    colors = {"dst_color_range": 2 if full_range else 1}
    if full_range:
        stream.codec_context.color_range = 2
    if matrix is not None:
        stream.codec_context.colorspace = colors["dst_colorspace"] = matrix
    return colors


def _write_clip(
    path: Path,
    *,
    count: int = 12,
    size: tuple[int, int] = (160, 96),
    rate: Fraction = Fraction(25),
    times: Sequence[Fraction] | None = None,
    codec: str = "libx264",
    pix_fmt: str = "yuv420p",
    options: dict[str, str] | None = None,
    rotation: int = 0,
    sounds: Sequence[str] = (),
    sound_seconds: float | None = None,
    movflags: str = "",
    full_range: bool = False,
    matrix: int | None = None,
) -> Path:
    """Write `count` numbered frames; `size` is of the upright picture."""
    times = times or [index / rate for index in range(count)]
    upright = [_draw_frame(number, *size) for number in range(len(times))]
    coded = [np.rot90(image, -rotation // 90) for image in upright]
    muxing = {"movflags": movflags} if movflags else {}
    with av.open(str(path), "w", container_options=muxing) as container:
        stream = container.add_stream(codec, rate=rate, options=options or {})
        assert isinstance(stream, av.VideoStream)
        stream.height, stream.width = coded[0].shape[:2]
        stream.pix_fmt = pix_fmt
        if codec.startswith(("libx", "libsvt")):
            stream.time_base = stream.codec_context.time_base = Fraction(1, 90_000)
        if rotation:
            stream.set_display_rotation(rotation)
        colors = _tag_colors(stream, full_range, matrix) if pix_fmt.startswith("yuv") else {}
        audio = [_add_sound(container, name) for name in sounds]
        seconds = float(times[-1] + 1 / rate) if sound_seconds is None else sound_seconds
        packets = [packet for track in audio for packet in _tone(track, seconds)]
        for image, time in zip(coded, times, strict=True):
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="bgr24")
            frame = frame.reformat(format=pix_fmt, **colors)
            ticks = stream.codec_context.time_base or 1 / rate
            frame.pts, frame.time_base = round(time / ticks), ticks
            packets += stream.encode(frame)
        packets += stream.encode(None)
        packets.sort(key=lambda packet: (packet.dts or 0) * packet.time_base)
        container.mux(packets)
    return path


@pytest.fixture(scope="session")
def draw_frame() -> Callable[[int, int, int], Image]:
    return _draw_frame


@pytest.fixture(scope="session")
def read_number() -> Callable[[Image], int]:
    return _read_number


@pytest.fixture(scope="session")
def write_clip() -> Callable[..., Path]:
    return _write_clip


@pytest.fixture
def plain_clip(tmp_path: Path) -> Path:
    """Twelve frames at 25 frames/s, with sound."""
    return _write_clip(tmp_path / "plain.mp4", sounds=["aac"], movflags="+faststart")


@pytest.fixture
def warnings(caplog: pytest.LogCaptureFixture) -> Callable[[], list[str]]:
    """What the program has warned of."""
    return lambda: [record.getMessage() for record in caplog.records if record.name == "vdet"]

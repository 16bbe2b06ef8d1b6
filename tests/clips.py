"""Clips drawn in code. Every frame shows its number, which can be read after it was coded."""

import contextlib
import math
import os
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
BITS = 6
RED = (40, 30, 210)  # BGR
NTSC = Fraction(30_000, 1001)
UNEVEN = [Fraction(ms, 1000) for ms in (0, 40, 50, 90, 300, 301, 340, 1340, 1341, 1400)]
MILLISECOND = Fraction(1, 1000)
B_FRAMES = {"bf": "3", "b-adapt": "0"}
NEGATIVE_TIMES = {"avoid_negative_ts": "disabled"}

ODD: dict[str, tuple[str, dict[str, Any]]] = {
    "constant rate": ("mp4", {}),
    "29.97": ("mp4", {"rate": NTSC, "count": 40}),
    "29.97 in mkv": ("mkv", {"rate": NTSC, "count": 40}),
    "variable rate": ("mp4", {"times": UNEVEN}),
    "variable rate in mkv": ("mkv", {"times": UNEVEN}),
    "one frame": ("mp4", {"count": 1}),
    "two frames": ("mp4", {"count": 2}),
    "b-frames": ("mp4", {"options": B_FRAMES, "count": 30}),
    "no b-frames": ("mp4", {"options": {"bf": "0"}}),
    "b-frames, no edit list": ("mp4", {"options": B_FRAMES, "muxing": {"use_editlist": "0"}}),
    "negative offsets": ("mp4", {"options": B_FRAMES, "movflags": "+negative_cts_offsets"}),
    "negative first time": ("mkv", {"begin": Fraction(-3, 25), "muxing": NEGATIVE_TIMES}),
    "first time not 0": ("ts", {}),
    "first time an hour late": ("mkv", {"begin": Fraction(3600)}),
    "b-frames in avi": ("avi", {"options": B_FRAMES, "count": 30, "sounds": ["libmp3lame"]}),
    "times missing": ("h264", {"options": {"bf": "2"}}),
    "sound": ("mp4", {"sounds": ["aac"]}),
    "sound in mkv": ("mkv", {"sounds": ["libopus"]}),
    "two sounds": ("mp4", {"sounds": ["aac", "ac3"]}),
    "sound longer than the picture": ("mp4", {"sounds": ["aac"], "sound_seconds": 2}),
    "turned by 90": ("mp4", {"rotation": 90}),
    "turned by 180": ("mp4", {"rotation": 180}),
    "turned by 270": ("mp4", {"rotation": 270}),
    "odd sides, 4:4:4": ("mp4", {"size": (853, 481), "pix_fmt": "yuv444p", "count": 3}),
    "odd sides, 4:2:0": ("mkv", {"size": (853, 481), "codec": "ffv1", "count": 3}),
    "odd sides, turned": ("mp4", {"size": (153, 97), "pix_fmt": "yuv444p", "rotation": 90}),
    "96×64": ("mp4", {"size": (96, 64)}),
    "grey": ("mp4", {"pix_fmt": "gray"}),
    "10 bits": ("mp4", {"pix_fmt": "yuv420p10le"}),
    "4:2:2": ("mp4", {"pix_fmt": "yuv422p"}),
    "full range": ("mp4", {"full_range": True}),
    "BT.601": ("mp4", {"matrix": 5}),
    "BT.601, full range": ("mp4", {"matrix": 5, "full_range": True}),
    "BT.709": ("mp4", {"matrix": 1}),
    "BT.709, full range": ("mp4", {"matrix": 1, "full_range": True}),
    "RGB": ("mkv", {"codec": "ffv1", "pix_fmt": "bgr0"}),
    "uncompressed BGR": ("avi", {"codec": "rawvideo", "pix_fmt": "bgr24"}),
    "vp9": ("webm", {"codec": "libvpx-vp9", "options": {"deadline": "realtime"}}),
    "vp9 in mkv": ("mkv", {"codec": "libvpx-vp9", "options": {"deadline": "realtime"}}),
    "vp8": ("webm", {"codec": "libvpx", "options": {"auto-alt-ref": "1", "lag-in-frames": "5"}}),
    "av1": ("mkv", {"codec": "libsvtav1", "options": {"preset": "12"}}),
    "av1 in webm": ("webm", {"codec": "libsvtav1", "options": {"preset": "12"}}),
    "motion jpeg": ("avi", {"codec": "mjpeg", "pix_fmt": "yuvj420p", "options": {"q": "2"}}),
    "mpeg-4 with b-frames": ("avi", {"codec": "mpeg4", "options": {"bf": "2", "q": "2"}}),
    "gif": ("gif", {"codec": "gif", "pix_fmt": "rgb8"}),
}
"""Suffix and arguments of `write_clip` for clips that are odd but legal."""


def draw_frame(number: int, width: int, height: int) -> Image:
    """Draw the number as black and white bars at the top, and a red corner at the bottom left."""
    image = np.full((height, width, 3), 110, np.uint8)
    for bit in range(BITS):
        columns = slice(bit * width // BITS, (bit + 1) * width // BITS)
        image[: height // 2, columns] = 235 if number >> bit & 1 else 20
    image[height // 2 :, : width // 2] = RED
    return image


def read_number(image: Image) -> int:
    height, width = image.shape[:2]
    row = image[height // 8 : 3 * height // 8].mean(axis=(0, 2))
    middles = [(2 * bit + 1) * width // (2 * BITS) for bit in range(BITS)]
    return sum(1 << bit for bit, x in enumerate(middles) if row[x - 2 : x + 3].mean() > 127)


def _add_sound(container: av.container.OutputContainer, codec: str) -> av.AudioStream:
    stream = container.add_stream(codec, rate=48000)
    assert isinstance(stream, av.AudioStream)
    stream.codec_context.layout = "mono"
    return stream


def _tone(stream: av.AudioStream, begin: Fraction, seconds: float) -> "list[av.Packet[Any]]":
    size = stream.codec_context.frame_size or 1024
    packets: list[av.Packet[Any]] = []
    first_sample = round(begin * 48000)
    resampler = av.AudioResampler(format=stream.codec_context.format, layout="mono", rate=48000)
    for first in range(0, math.ceil(seconds * 48000), size):
        wave = 0.3 * np.sin(np.arange(first, first + size) * 2 * np.pi * 440 / 48000)
        frame = av.AudioFrame.from_ndarray(
            (wave[None] * 32767).astype(np.int16), format="s16", layout="mono"
        )
        frame.sample_rate, frame.time_base = 48000, Fraction(1, 48000)
        frame.pts = first_sample + first
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


def _give_back_priority(codec: str) -> None:
    """Run all threads as before: run as root, SVT-AV1 gives them real-time priority."""
    tasks = Path("/proc/self/task")
    for task in tasks.iterdir() if codec == "libsvtav1" and tasks.exists() else ():
        with contextlib.suppress(ProcessLookupError):
            os.sched_setscheduler(int(task.name), os.SCHED_OTHER, os.sched_param(0))


def write_clip(
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
    muxing: dict[str, str] | None = None,
    begin: Fraction = Fraction(0),
    full_range: bool = False,
    matrix: int | None = None,
) -> Path:
    """Write `count` numbered frames and sound from `begin` on; `size` is of the upright picture."""
    times = times or [index / rate for index in range(count)]
    upright = [draw_frame(number, *size) for number in range(len(times))]
    coded = [np.rot90(image, -rotation // 90) for image in upright]
    muxing = (muxing or {}) | ({"movflags": movflags} if movflags else {})
    with av.open(str(path), "w", container_options=muxing) as container:
        stream = container.add_stream(codec, rate=rate, options=options or {})
        assert isinstance(stream, av.VideoStream)
        stream.height, stream.width = coded[0].shape[:2]
        stream.pix_fmt = pix_fmt
        if codec.startswith(("libx", "libsvt")) and path.suffix not in (".avi", ".h264"):
            stream.time_base = stream.codec_context.time_base = Fraction(1, 90_000)
        if rotation:
            stream.set_display_rotation(rotation)
        colors = _tag_colors(stream, full_range, matrix) if pix_fmt.startswith("yuv") else {}
        audio = [_add_sound(container, name) for name in sounds]
        seconds = float(times[-1] + 1 / rate) if sound_seconds is None else sound_seconds
        packets = [packet for track in audio for packet in _tone(track, begin, seconds)]
        for image, time in zip(coded, times, strict=True):
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="bgr24")
            frame = frame.reformat(format=pix_fmt, **colors)
            ticks = stream.codec_context.time_base or 1 / rate
            frame.pts, frame.time_base = round((begin + time) / ticks), ticks
            packets += stream.encode(frame)
            _give_back_priority(codec)
        packets += stream.encode(None)
        packets.sort(key=lambda packet: (packet.dts or 0) * packet.time_base)
        container.mux(packets)
    return path


def times_of(spec: dict[str, Any]) -> list[Fraction]:
    given: list[Fraction] | None = spec.get("times")
    return given or [
        index / spec.get("rate", Fraction(25)) for index in range(spec.get("count", 12))
    ]


def sound_of(path: Path, track: int = 0) -> list[tuple[Fraction, bytes]]:
    """Return the packets of a sound, with their times after the first picture in seconds."""
    with av.open(str(path)) as container:
        stream, picture = container.streams.audio[track], container.streams.video[0]
        begin = (picture.start_time or 0) * (picture.time_base or 0)
        return [
            ((packet.pts or 0) * packet.time_base - begin, bytes(packet))
            for packet in container.demux(stream)
            if packet.size
        ]


def remuxed(
    path: Path,
    source: Path,
    *,
    first: int = 0,
    copies: int = 1,
    shift: int = 0,
    tags: dict[str, str] | None = None,
    muxing: dict[str, str] | None = None,
) -> Path:
    """Write the packets of a video, from `first` on, into each of `copies` streams of a file.

    `shift` is added to their times, in the time base of the source.
    """
    options = muxing or {}
    with av.open(source) as read, av.open(path, "w", container_options=options) as written:
        written.metadata.update(tags or {})
        streams = [written.add_stream_from_template(read.streams.video[0]) for _ in range(copies)]
        packets = [packet for packet in read.demux(video=0) if packet.dts is not None]
        for packet in packets[first:]:
            packet.pts, packet.dts = (packet.pts or 0) + shift, (packet.dts or 0) + shift
            for stream in streams:
                packet.stream = stream
                written.mux(packet)
    return path


def joined(path: Path, *parts: Path) -> Path:
    """Write a file of the bytes of others, one after the other."""
    path.write_bytes(b"".join(part.read_bytes() for part in parts))
    return path

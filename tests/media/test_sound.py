"""Sound is copied into the written video, packet by packet, in step with the picture."""

import os
import threading
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from clips import sound_of, write_clip
from vdet.config.schema import OutputSettings
from vdet.media.reader import VideoReader
from vdet.media.writer import VideoWriter

Warnings = Callable[[], list[str]]
Sound = list[tuple[Fraction, bytes]]
FAST = OutputSettings(preset="ultrafast")


def copy(source: Path, target: Path) -> Path:
    with (
        VideoReader(source) as reader,
        VideoWriter(target, reader.info, FAST, whole_audio=True) as writer,
    ):
        for frame in reader:
            writer.write(frame)
    return target


def assert_same(sound: Sound, original: Sound) -> None:
    assert [data for _, data in sound] == [data for _, data in original]
    times = [time for time, _ in sound]
    assert times == pytest.approx([time for time, _ in original], abs=0.001)


@pytest.mark.parametrize(
    ("codec", "suffix"), [("aac", "mp4"), ("ac3", "mov"), ("aac", "mkv"), ("libmp3lame", "mkv")]
)
def test_sound_is_copied_bit_for_bit(
    codec: str, suffix: str, tmp_path: Path, warnings: Warnings
) -> None:
    source = write_clip(tmp_path / "in.mp4", sounds=[codec], sound_seconds=1)
    written = sound_of(copy(source, tmp_path / f"out.{suffix}"))
    original = [packet for packet in sound_of(source) if suffix != "mkv" or packet[0] >= 0]
    assert len(original) > 20
    assert_same(written, original)
    assert warnings() == []


@pytest.mark.parametrize(("codec", "suffix"), [("pcm_mulaw", "avi"), ("pcm_s16le", "mkv")])
@pytest.mark.parametrize("rate", [44_100, 11_000])
def test_sound_that_mp4_cannot_hold_is_encoded(
    codec: str, suffix: str, rate: int, tmp_path: Path, warnings: Warnings
) -> None:
    source = tmp_path / f"in.{suffix}"
    seconds = np.arange(rate) / rate
    beep = np.sin(2 * np.pi * 440 * seconds) * (np.abs(seconds - 0.6) < 0.05)
    with av.open(str(source), "w") as container:
        video = container.add_stream("mpeg4", rate=25)
        sound = container.add_stream(codec, rate=rate, layout="mono")
        assert isinstance(video, av.VideoStream)
        assert isinstance(sound, av.AudioStream)
        video.width, video.height, video.pix_fmt = 64, 48, "yuv420p"
        for _ in range(25):
            image = av.VideoFrame.from_ndarray(np.zeros((48, 64, 3), np.uint8), format="bgr24")
            container.mux(video.encode(image))
        samples = av.AudioFrame.from_ndarray(
            (20_000 * beep).astype(np.int16)[np.newaxis], format="s16", layout="mono"
        )
        samples.sample_rate = rate
        container.mux([*video.encode(None), *sound.encode(samples), *sound.encode(None)])
    target = copy(source, tmp_path / "out.mp4")
    with av.open(str(target)) as container:
        assert container.streams.audio[0].codec_context.name == "aac"
        frames = [(frame, frame.to_ndarray()[0]) for frame in container.decode(audio=0)]
    times = np.concatenate([float(f.time or 0) + np.arange(f.samples) / f.rate for f, _ in frames])
    loud = times[np.abs(np.concatenate([samples for _, samples in frames])) > 0.1]
    assert (loud.min(), loud.max()) == pytest.approx((0.55, 0.65), abs=0.02)
    assert times.max() == pytest.approx(1, abs=0.05)
    assert warnings() == []


def test_every_sound_stream_is_copied(tmp_path: Path) -> None:
    source = write_clip(tmp_path / "in.mkv", sounds=["aac", "libmp3lame"])
    target = copy(source, tmp_path / "out.mkv")
    for track in (0, 1):
        kept = [packet for packet in sound_of(source, track) if packet[0] >= 0]
        assert_same(sound_of(target, track), kept)


def test_damaged_sound_does_not_affect_the_picture(tmp_path: Path, warnings: Warnings) -> None:
    source = write_clip(tmp_path / "in.ts", sounds=["aac"], count=50)
    data = bytearray(source.read_bytes())
    rng = np.random.default_rng(0)
    sound_id = 0x101  # of the second stream, in bits 11 … 23 of each packet of 188 bytes
    for first in range(0, len(data), 5 * 188):
        if int.from_bytes(data[first + 1 : first + 3]) & 0x1FFF == sound_id:
            data[first + 24 : first + 188] = rng.bytes(164)
    source.write_bytes(data)
    target = copy(source, tmp_path / "out.mp4")
    (warning,) = warnings()
    assert warning.startswith(f"{source}: ")
    assert "audio packets dropped: damaged" in warning
    with VideoReader(target) as reader:
        assert len(list(reader)) == 50
    assert sound_of(target)


def test_the_sound_of_a_pipe_is_left_out_with_a_warning(tmp_path: Path, warnings: Warnings) -> None:
    source, pipe = write_clip(tmp_path / "in.ts", sounds=["aac"]), tmp_path / "pipe.ts"
    os.mkfifo(pipe)
    feeder = threading.Thread(target=lambda: pipe.write_bytes(source.read_bytes()))
    feeder.start()
    target = copy(pipe, tmp_path / "out.mp4")
    feeder.join()
    with av.open(str(target)) as container:
        assert container.streams.video[0].frames == 12
        assert not container.streams.audio
    assert warnings() == [f"{pipe}: its audio is dropped: a pipe can be read only once"]

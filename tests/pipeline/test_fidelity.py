"""What a written video keeps of its source: sound, times, the upright picture."""

import json
from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from pipeline.red_runs import outputs, read, run_red, with_search
from red_cars import HEIGHT, SETTINGS, WIDTH, car_at, road
from vdet.config.schema import WindowSettings
from vdet.media import VideoReader
from vdet.media.frame import Orientation
from vdet.pipeline.loop import VideoJob

TONE_RATE = 48_000


def since_first(path: Path) -> list[Fraction]:
    times = [frame.time for frame in read(path)]
    return [time - times[0] for time in times]


def _remuxed(
    source: Path,
    target: Path,
    *,
    stretch: Callable[[int], int] = lambda ticks: ticks,
    rotation: int = 0,
    tone: bool = False,
) -> Path:
    """Copy a clip's coded pictures, with other times, a rotation, or a tone beside them."""
    with av.open(str(source)) as original, av.open(str(target), "w") as copy:
        video = copy.add_stream_from_template(original.streams.video[0])
        if rotation:
            video.set_display_rotation(rotation)
        packets = _tone(copy, seconds=2.4) if tone else []
        for packet in original.demux(video=0):
            if packet.pts is not None and packet.dts is not None:
                packet.pts, packet.dts = stretch(packet.pts), stretch(packet.dts)
                packet.stream = video
                packets.append(packet)
        packets.sort(key=lambda packet: (packet.dts or 0) * packet.time_base)
        copy.mux(packets)
    return target


def _tone(container: av.container.OutputContainer, seconds: float) -> "list[av.Packet[Any]]":
    stream = container.add_stream("aac", rate=TONE_RATE)
    assert isinstance(stream, av.AudioStream)
    stream.codec_context.layout = "mono"
    packets: list[av.Packet[Any]] = []
    for first in range(0, int(seconds * TONE_RATE), 1024):
        wave = 0.3 * np.sin(np.arange(first, first + 1024) * 2 * np.pi * 440 / TONE_RATE)
        frame = av.AudioFrame.from_ndarray(wave[None].astype(np.float32), "fltp", "mono")
        frame.sample_rate, frame.pts = TONE_RATE, first
        packets += stream.encode(frame)
    return packets + stream.encode(None)


def _sound(path: Path) -> list[tuple[float, bytes]]:
    """Return the packets with their times after the first picture, in seconds."""
    with av.open(str(path)) as container:
        picture = container.streams.video[0]
        begin = (picture.start_time or 0) * (picture.time_base or 0)
        return [
            (float((packet.pts or 0) * packet.time_base - begin), bytes(packet))
            for packet in container.demux(audio=0)
            if packet.size
        ]


class TestFidelity:
    def test_sound_is_kept_to_the_bit_and_in_step(self, red_clip: Path, tmp_path: Path) -> None:
        source = _remuxed(red_clip, tmp_path / "in.mp4", tone=True)
        run_red(VideoJob(source, outputs(video=tmp_path / "out.mp4")))
        before, after = _sound(source), _sound(tmp_path / "out.mp4")
        assert len(before) > 100
        assert [data for _, data in after] == [data for _, data in before]
        assert [t for t, _ in after] == pytest.approx([t for t, _ in before], abs=0.001)

    def test_a_part_has_the_sound_of_that_part(self, red_clip: Path, tmp_path: Path) -> None:
        source = _remuxed(red_clip, tmp_path / "in.mp4", tone=True)
        begin, end = Fraction(10, 25), Fraction(35, 25)
        run_red(VideoJob(source, outputs(video=tmp_path / "out.mp4"), start=begin, end=end))
        after = _sound(tmp_path / "out.mp4")
        assert len(after) == pytest.approx(float(end - begin) * TONE_RATE / 1024, abs=2)
        times = {data: time - float(begin) for time, data in _sound(source)}
        assert [time for time, _ in after] == pytest.approx(
            [times[data] for _, data in after], abs=0.001
        )

    def test_times_of_a_variable_frame_rate_are_exact(self, red_clip: Path, tmp_path: Path) -> None:
        def slower_and_slower(ticks: int) -> int:
            return ticks + ticks * abs(ticks) // 50_000

        source = _remuxed(red_clip, tmp_path / "in.mp4", stretch=slower_and_slower)
        wanted = outputs(video=tmp_path / "out.mp4", tracks=tmp_path / "out.jsonl")
        run_red(VideoJob(source, wanted))
        times = [frame.time for frame in read(source)]
        steps = {later - earlier for earlier, later in pairwise(times)}
        assert len(steps) > 20, "the clip's rate does not vary"
        assert since_first(tmp_path / "out.mp4") == since_first(source)
        records = (tmp_path / "out.jsonl").read_text().splitlines()
        assert [json.loads(line)["time"] for line in records] == [
            round(float(time), 6) for time in times
        ]

    @pytest.mark.parametrize("rotation", [90, 180, 270])
    def test_a_rotated_clip_comes_out_upright(
        self, red_clip: Path, tmp_path: Path, rotation: int
    ) -> None:
        source = _remuxed(red_clip, tmp_path / "in.mp4", rotation=rotation)
        job = VideoJob(source, outputs(video=tmp_path / "out.mp4"), frames=5)
        summary = run_red(job, with_search(SETTINGS, probability=1.0))
        assert summary.frames == 5
        with VideoReader(tmp_path / "out.mp4") as reader:
            assert reader.info.orientation == Orientation()
            written = [frame.image for frame in reader]
        turned = np.rot90(road(car_at(2)), rotation // 90)
        assert written[2].shape == turned.shape
        assert np.abs(written[2].astype(int) - turned).mean() < 4

    def test_a_car_in_a_rotated_clip_is_found_upright(self, red_clip: Path, tmp_path: Path) -> None:
        source = _remuxed(red_clip, tmp_path / "in.mp4", rotation=180)
        whole = (WindowSettings(size=32, overlap=0.75, top=0, bottom=HEIGHT),)
        job = VideoJob(source, outputs(tracks=tmp_path / "out.jsonl"), frames=15)
        run_red(job, with_search(SETTINGS, windows=whole))
        last = json.loads((tmp_path / "out.jsonl").read_text().splitlines()[-1])
        (track,) = last["tracks"]
        car = car_at(14)
        middle = WIDTH - car.center[0], HEIGHT - car.center[1]
        assert track["x"] + track["width"] / 2 == pytest.approx(middle[0], abs=10)
        assert track["y"] + track["height"] / 2 == pytest.approx(middle[1], abs=10)

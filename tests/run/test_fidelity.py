"""What a written video keeps of its source: sound, times, the upright picture."""

import json
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from red_cars import HEIGHT, SETTINGS, WIDTH, car_at, drive, road
from run.red_runs import outputs, read, run_red, video_info, with_search
from vdet.config.schema import DrawSettings, OutputSettings, Settings
from vdet.media import ColorTags, Picture
from vdet.media.frame import UNSPECIFIED, Coding, Planes
from vdet.media.images import Orientation
from vdet.media.reader import VideoReader
from vdet.media.writer import VideoWriter
from vdet.run.video import Run

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


CODINGS = {
    "untagged": (Coding(), UNSPECIFIED),
    "BT.601": (Coding(), 6),
    "BT.709": (Coding("bt709"), 1),
    "BT.601, full range": (Coding(full_range=True), 6),
    "BT.709, full range": (Coding("bt709", full_range=True), 1),
}
"""How the source is coded, and the tag of its matrix."""
FRAMES = 30
LABEL = 30
"""Pixels above a box that its label may need."""


@pytest.fixture(scope="module", params=CODINGS)
def filmed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A red car on a road with noise, which no encoder leaves as it is."""
    coding, matrix = CODINGS[request.param]
    path = tmp_path_factory.mktemp("filmed") / "in.mp4"
    info = replace(video_info(), color=ColorTags(matrix=matrix), coding=coding)
    noise = np.random.default_rng(0).integers(0, 40, (FRAMES, HEIGHT, WIDTH, 3), np.uint8)
    with VideoWriter(path, info, OutputSettings(crf=15)) as writer:
        for frame in drive(FRAMES):
            grainy = np.where(frame.image > 200, frame.image, frame.image + noise[frame.index])
            writer.write(replace(frame, picture=Picture(grainy.astype(np.uint8))))
    return path


def written_with(settings: OutputSettings, **draw: Any) -> Settings:
    return SETTINGS.model_copy(update={"output": settings, "draw": DrawSettings(**draw)})


def planes_of(path: Path) -> list[Planes]:
    """Return what the decoder gives."""
    found = [frame.picture.planes for frame in read(path)]
    planes = [item for item in found if item is not None]
    assert len(planes) == len(found) == FRAMES
    return planes


def untouched(track_file: Path) -> list[NDArray[np.bool_]]:
    """Tell for each frame, by value of chroma, what lies away from the outlines and labels."""
    masks = []
    for line in track_file.read_text().splitlines():
        mask = np.ones((HEIGHT // 2, WIDTH // 2), bool)
        for track in json.loads(line)["tracks"]:
            x, y, width, height = (track[key] for key in ("x", "y", "width", "height"))
            left, right, top, bottom = x - 4, x + max(width, 40) + 4, y - LABEL, y + height + 4
            mask[max(0, top // 2) : bottom // 2 + 1, max(0, left // 2) : right // 2 + 1] = False
            inner = np.s_[y // 2 + 4 : (y + height) // 2 - 4, x // 2 + 4 : (x + width) // 2 - 4]
            mask[inner] = True
        masks.append(mask)
    return masks


def doubled(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell it by pixel."""
    return mask.repeat(2, axis=0).repeat(2, axis=1)


class TestPixels:
    """What is not drawn on is changed by the encoder alone."""

    def test_without_loss_in_the_encoder_they_are_those_of_the_source(
        self, filmed: Path, tmp_path: Path
    ) -> None:
        """Far from boxes and labels, and inside boxes: luma and chroma are equal, bit for bit."""
        wanted = outputs(video=tmp_path / "out.mp4", tracks=tmp_path / "out.jsonl")
        settings = written_with(OutputSettings(preset="ultrafast", crf=0))
        run_red(Run(filmed, wanted), settings)
        masks = untouched(tmp_path / "out.jsonl")
        drawn = 0
        pairs = zip(planes_of(filmed), planes_of(tmp_path / "out.mp4"), strict=True)
        for mask, (before, after) in zip(masks, pairs, strict=True):
            changed = after.luma != before.luma
            assert not (changed & doubled(mask)).any()
            for old, new in ((before.blue, after.blue), (before.red, after.red)):
                assert not ((new != old) & mask).any()
            if not mask.all():
                assert changed.any()
                drawn += 1
        assert drawn > FRAMES // 2, "there are boxes"


class TestFidelity:
    def test_sound_is_kept_to_the_bit_and_in_step(self, red_clip: Path, tmp_path: Path) -> None:
        source = _remuxed(red_clip, tmp_path / "in.mp4", tone=True)
        run_red(Run(source, outputs(video=tmp_path / "out.mp4")))
        before, after = _sound(source), _sound(tmp_path / "out.mp4")
        assert len(before) > 100
        assert [data for _, data in after] == [data for _, data in before]
        assert [t for t, _ in after] == pytest.approx([t for t, _ in before], abs=0.001)

    def test_a_part_has_the_sound_of_that_part(self, red_clip: Path, tmp_path: Path) -> None:
        source = _remuxed(red_clip, tmp_path / "in.mp4", tone=True)
        begin, end = Fraction(10, 25), Fraction(35, 25)
        run_red(Run(source, outputs(video=tmp_path / "out.mp4"), start=begin, end=end))
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
        run_red(Run(source, wanted))
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
        job = Run(source, outputs(video=tmp_path / "out.mp4"), frames=5)
        totals = run_red(job, with_search(SETTINGS, probability=1.0))
        assert totals.frames == 5
        with VideoReader(tmp_path / "out.mp4") as reader:
            assert reader.info.orientation == Orientation()
            written = [frame.image for frame in reader]
        turned = np.rot90(road(car_at(2)), rotation // 90)
        assert written[2].shape == turned.shape
        assert np.abs(written[2].astype(int) - turned).mean() < 4

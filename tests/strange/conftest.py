"""Run the whole command on odd clips, with settings that make it quick."""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from clips import MILLISECOND, Image, read_number
from conftest import Run
from quick import FEW_OPTIONS


@dataclass(frozen=True)
class Shown:
    """The content of an output, and the warnings of the run.

    `sounds` is the number of packets of each sound stream.
    """

    images: list[Image]
    times: list[Fraction]
    sounds: dict[str, int]
    warnings: list[str]


Process = Callable[..., Shown]


def assert_whole(shown: Shown, numbers: list[int], rate: Fraction = Fraction(25)) -> None:
    """Assert that these frames, and no others, are shown at a constant rate."""
    assert [read_number(image) for image in shown.images] == numbers
    for index, time in enumerate(shown.times):
        assert abs(time - index / rate) <= MILLISECOND


def _read(path: Path, err: str) -> Shown:
    """Read an output, without any code of vdet."""
    with av.open(str(path)) as container:
        (stream,) = container.streams.video
        assert stream.codec_context.name == "h264"
        assert stream.codec_context.pix_fmt in ("yuv420p", "yuvj420p")  # with the full range
        base = stream.time_base or Fraction(0)
        pictures = [(picture, (picture.pts or 0) * base) for picture in container.decode(stream)]
        images = [
            np.asarray(picture.to_ndarray(format="bgr24"), np.uint8) for picture, _ in pictures
        ]
    sounds = {}
    with av.open(str(path)) as container:
        for track in container.streams.audio:
            container.seek(0)
            count = sum(1 for packet in container.demux(track) if packet.size)
            sounds[f"{track.index} {track.codec_context.name}"] = count
    warnings = [line for line in err.splitlines() if "warning: " in line]
    return Shown(images, [time for _, time in pictures], sounds, warnings)


@pytest.fixture
def process(run: Run, tmp_path: Path) -> Process:
    """Run `vdet detect-video`, which must succeed and write only its output."""

    def process_it(source: Path, *options: str, suffix: str = "mp4") -> Shown:
        folder = tmp_path / "out"
        folder.mkdir()
        out = folder / f"out.{suffix}"
        result = run("detect-video", source, out, *FEW_OPTIONS, *options, code=0)
        assert [path.name for path in folder.iterdir()] == [out.name]
        return _read(out, result.err)

    return process_it

"""The sink `clips`: which parts of a video it cuts out, and how."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import av
import pytest

from clips import B_FRAMES, joined, read_number, write_clip
from red_cars import CAR, SETTINGS
from run.red_runs import read, result_of, write
from running import names
from vdet.config.schema import ClipSettings
from vdet.media.reader import VideoReader
from vdet.run.result import FrameResult
from vdet.run.sinks import Output
from vdet.track.track import Track

RATE = Fraction(25)
COUNT = 63
SHOWN = {1: ("car", range(22, 27)), 2: ("car", range(25, 29)), 3: ("fire truck", range(50, 52))}
"""The class of each vehicle, and the frames that show it."""


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clip with sound and a key frame in every ten frames."""
    path = tmp_path_factory.mktemp("source") / "in.mp4"
    return write_clip(path, count=COUNT, options=B_FRAMES | {"g": "10"}, sounds=["aac"])


def results() -> list[FrameResult]:
    found = []
    for index in range(COUNT):
        shown = [
            Track(number, CAR, 0.9, "detected", kind)
            for number, (kind, frames) in SHOWN.items()
            if index in frames
        ]
        found.append(result_of(*shown, index=index, time=index / RATE))
    return found


def cut(source: Path, folder: Path, *, exact: bool = False) -> dict[str, list[int]]:
    """Return the numbers of the frames of each clip, by its name."""
    settings = SETTINGS.model_copy(update={"clips": ClipSettings(margin=0.2, exact=exact)})
    with VideoReader(source) as reader:
        video = replace(reader.info)
    write(Output("clips", folder), results(), settings=settings, video=video)
    return {
        name: [read_number(frame.image) for frame in read(folder / name)] for name in names(folder)
    }


def test_a_clip_is_copied_from_key_frame_to_key_frame_for_each_time_with_vehicles(
    source: Path, tmp_path: Path
) -> None:
    assert cut(source, tmp_path) == {
        "clip-00-00-00-car-1+1.mp4": list(range(10, 40)),
        "clip-00-00-02-fire-truck-3.mp4": list(range(40, 60)),
    }
    with av.open(str(tmp_path / "clip-00-00-00-car-1+1.mp4")) as clip:
        seconds = sum(frame.samples for frame in clip.decode(audio=0)) / 48000
    assert seconds == pytest.approx(30 / RATE, abs=0.1), "with the sound of its frames"


def test_an_exact_clip_has_the_frames_from_the_margin_before_to_the_margin_after(
    source: Path, tmp_path: Path
) -> None:
    assert cut(source, tmp_path, exact=True) == {
        "clip-00-00-00-car-1+1.mp4": list(range(17, 33)),
        "clip-00-00-02-fire-truck-3.mp4": list(range(45, 56)),
    }


def test_where_the_clock_may_restart_clips_are_exact(tmp_path: Path) -> None:
    part = write_clip(tmp_path / "a.ts", count=40, options={"g": "10"})
    stream = joined(tmp_path / "in.ts", part, part)
    (tmp_path / "clips").mkdir()
    assert [len(found) for found in cut(stream, tmp_path / "clips").values()] == [16, 11]

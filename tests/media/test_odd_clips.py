"""The contract of the reader: odd but legal clips give all frames, upright, at their times."""

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from clips import MILLISECOND, ODD, RED, times_of
from vdet.config.schema import OutputSettings
from vdet.media import Frame, VideoReader, VideoWriter


def read_all(path: Path) -> list[Frame]:
    with VideoReader(path) as reader:
        return list(reader)


def assert_times(frames: list[Frame], expected: list[Fraction]) -> None:
    since = [frame.time - frames[0].time for frame in frames]
    assert len(since) == len(expected)
    assert all(abs(a - b) <= MILLISECOND for a, b in zip(since, expected, strict=True))


@pytest.fixture(params=ODD, scope="module")
def clip(
    request: pytest.FixtureRequest,
    tmp_path_factory: pytest.TempPathFactory,
    write_clip: Callable[..., Path],
) -> tuple[Path, dict[str, Any]]:
    suffix, spec = ODD[request.param]
    return write_clip(tmp_path_factory.mktemp("clip") / f"clip.{suffix}", **spec), spec


@pytest.fixture
def silent(warnings: Callable[[], list[str]]) -> Any:
    yield
    assert warnings() == []


@pytest.mark.usefixtures("silent")
def test_frames_come_complete_in_order_and_at_their_times(
    clip: tuple[Path, dict[str, Any]], read_number: Callable[[NDArray[np.uint8]], int]
) -> None:
    path, spec = clip
    with VideoReader(path) as reader:
        frames = list(reader)
        assert reader.damaged == 0
    assert [read_number(frame.image) for frame in frames] == list(range(len(times_of(spec))))
    assert [frame.index for frame in frames] == list(range(len(frames)))
    assert_times(frames, times_of(spec))
    assert frames[0].time == reader.info.start


def test_images_are_upright_bgr_of_the_declared_size(clip: tuple[Path, dict[str, Any]]) -> None:
    path, spec = clip
    width, height = spec.get("size", (160, 96))
    with VideoReader(path) as reader:
        assert (reader.info.width, reader.info.height) == (width, height)
        for frame in reader:
            assert frame.image.shape == (height, width, 3)
            assert frame.image.dtype == np.uint8
            assert frame.image.flags.c_contiguous
            assert frame.image.flags.writeable
            corner = frame.image[height * 5 // 8 : height * 7 // 8, width // 8 : width * 3 // 8]
            if spec.get("pix_fmt") == "gray":
                assert np.ptp(corner.mean(axis=(0, 1))) < 1
            else:
                tolerance = 25 if path.suffix == ".gif" else 5
                assert np.abs(corner.mean(axis=(0, 1)) - RED).max() < tolerance


def test_the_expected_number_of_frames_is_known_where_the_file_declares_it(
    clip: tuple[Path, dict[str, Any]],
) -> None:
    path, spec = clip
    with VideoReader(path) as reader:
        if path.suffix == ".h264":
            assert reader.expected is None
        elif not {"sound_seconds", "times", "begin"} & spec.keys():
            assert reader.expected == pytest.approx(len(times_of(spec)), abs=1)


@pytest.mark.usefixtures("silent")
@pytest.mark.parametrize("suffix", ["mp4", "mkv"])
def test_a_copy_has_the_same_frames_at_the_same_times(
    clip: tuple[Path, dict[str, Any]],
    suffix: str,
    tmp_path: Path,
    read_number: Callable[[NDArray[np.uint8]], int],
) -> None:
    source, spec = clip
    copy = tmp_path / f"copy.{suffix}"
    settings = OutputSettings(preset="ultrafast")
    with VideoReader(source) as reader, VideoWriter(copy, reader.info, settings) as writer:
        for frame in reader:
            writer.write(frame)
    frames = read_all(copy)
    assert [read_number(frame.image) for frame in frames] == list(range(len(times_of(spec))))
    assert_times(frames, times_of(spec))
    is_full = spec.get("full_range") or spec.get("pix_fmt") == "yuvj420p"
    with av.open(str(copy)) as container:
        pixels = container.streams.video[0].codec_context.pix_fmt
        assert pixels == ("yuvj420p" if is_full else "yuv420p"), "the range is kept"
        assert container.streams.video[0].codec_context.name == "h264"
        assert len(container.streams.audio) == len(spec.get("sounds", []))

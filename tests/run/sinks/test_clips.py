"""The sink `clips`: which parts of a video it cuts out, and how."""

import os
import re
import resource
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import closing
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from shutil import copy
from typing import Any

import av
import pytest

from clips import B_FRAMES, joined, read_number, write_clip
from red_cars import CAR, SETTINGS
from run.red_runs import read, result_of, write
from running import names
from vdet.config.schema import ClipSettings
from vdet.errors import OutputError
from vdet.files import OutputFiles
from vdet.media.reader import Demuxer, VideoReader
from vdet.run.sinks import Output
from vdet.run.sinks.protocol import check_sinks
from vdet.run.steps import FrameResult
from vdet.track.track import Track

RATE = Fraction(25)
COUNT = 63
Shown = Mapping[int, tuple[str, Collection[int]]]
SHOWN: Shown = {
    1: ("car", range(22, 27)),
    2: ("car", range(25, 29)),
    3: ("fire truck", range(50, 52)),
}
"""The class of each vehicle, and the frames that show it."""


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clip with sound and a key frame in every ten frames."""
    path = tmp_path_factory.mktemp("source") / "in.mp4"
    return write_clip(path, count=COUNT, options=B_FRAMES | {"g": "10"}, sounds=["aac"])


def results(vehicles: Shown = SHOWN, count: int = COUNT) -> list[FrameResult]:
    found = []
    for index in range(count):
        shown = [
            Track(number, CAR, 0.9, "detected", kind)
            for number, (kind, frames) in vehicles.items()
            if index in frames
        ]
        found.append(result_of(*shown, index=index, time=index / RATE))
    return found


def cut(
    source: Path,
    folder: Path,
    *,
    exact: bool = False,
    margin: float = 0.2,
    shown: Iterable[FrameResult] | None = None,
) -> dict[str, list[int]]:
    """Return the numbers of the frames of each clip, by its name."""
    settings = SETTINGS.model_copy(update={"clips": ClipSettings(margin=margin, exact=exact)})
    with VideoReader(source) as reader:
        video = replace(reader.info)
    frames = results() if shown is None else shown
    write(Output("clips", folder), frames, settings=settings, video=video)
    clips = [path for path in sorted(folder.iterdir()) if path.is_file()]
    return {path.name: [read_number(frame.image) for frame in read(path)] for path in clips}


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


LAST = [COUNT - 2, COUNT - 1]


@pytest.mark.parametrize(
    ("margin", "shown", "clips"),
    [
        (0.2, SHOWN, [[*range(17, 34)], [*range(45, 57)]]),
        (
            *(0, {1: ("car", [20, 21]), 2: ("car", range(30, 34)), 3: ("bus", LAST)}),
            [[20, 21], [30, 31, 32, 33], LAST],
        ),
    ],
)
def test_an_exact_clip_has_the_frames_from_the_margin_before_to_the_margin_after(
    source: Path, tmp_path: Path, margin: float, shown: Shown, clips: list[list[int]]
) -> None:
    found = cut(source, tmp_path, exact=True, margin=margin, shown=results(shown))
    assert list(found.values()) == clips


def test_a_clip_that_cannot_be_cut_is_left_out_with_a_warning(
    source: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    beyond = results({1: ("car", [20, 21]), 2: ("bus", range(COUNT, COUNT + 2))}, count=COUNT + 2)
    assert list(cut(source, tmp_path, exact=True, margin=0, shown=beyond)) == [
        "clip-00-00-00-car-1.mp4"
    ]
    assert "in.mp4: the clip clip-00-00-02-bus-2 was not written: " in caplog.text


def test_damage_that_the_run_tolerates_is_tolerated_in_exact_clips(
    source: Path, tmp_path: Path
) -> None:
    data = bytearray(source.read_bytes())
    with av.open(str(source)) as container:
        packets = [packet for packet in container.demux(video=0) if packet.pos is not None]
    for packet in packets[24:27]:
        begin = packet.pos or 0
        data[begin + 4 : begin + packet.size] = bytes(packet.size - 4)
    (tmp_path / "in.mp4").write_bytes(data)
    (tmp_path / "clips").mkdir()
    assert len(cut(tmp_path / "in.mp4", tmp_path / "clips", exact=True)) == 2


def test_a_clip_shows_nothing_that_an_edit_list_hides(tmp_path: Path) -> None:
    video = write_clip(
        tmp_path / "in.mov",
        count=COUNT,
        begin=Fraction(-15, 25),
        options={"g": "30", "bf": "0"},
        muxing={"avoid_negative_ts": "disabled"},
    )
    assert read_number(read(video)[0].image) == 15, "the file hides 15 frames"
    (tmp_path / "clips").mkdir()
    shown = results({1: ("car", range(2, 7)), 2: ("bus", range(30, 33))}, count=48)
    assert cut(video, tmp_path / "clips", shown=shown) == {
        "clip-00-00-00-car-1.mp4": list(range(15, 27)),
        "clip-00-00-01-bus-2.mp4": list(range(30, 60)),
    }


def test_where_the_clock_may_restart_clips_are_exact(tmp_path: Path) -> None:
    part = write_clip(tmp_path / "a.ts", count=40, options={"g": "10"})
    stream = joined(tmp_path / "in.ts", part, part)
    (tmp_path / "clips").mkdir()
    assert [len(found) for found in cut(stream, tmp_path / "clips").values()] == [17, 12]


COPIES = range(40), range(40, 60)
ENCODED = range(17, 34), range(45, 57)


@pytest.mark.parametrize(
    ("suffix", "options", "expected"),
    [
        ("mkv", {"options": B_FRAMES | {"g": "10"}}, (range(10, 40), range(40, 60))),
        ("mov", {"options": {"g": "20"}, "sounds": ["pcm_s16le"]}, ENCODED),
        ("mkv", {"codec": "libx265", "options": {"x265-params": "log-level=none"}}, ENCODED),
        ("flv", {"options": {"g": "20"}}, COPIES),
        ("avi", {"options": {"g": "20", "bf": "0"}}, COPIES),
        ("avi", {"options": B_FRAMES | {"g": "10"}, "sounds": ["pcm_s16le"]}, ENCODED),
        ("avi", {"codec": "mpeg4", "sounds": ["adpcm_ms"]}, ENCODED),
        ("h264", {"options": {"g": "10"}}, ENCODED),
        ("y4m", {"codec": "wrapped_avframe"}, ENCODED),
        ("3gp", {"codec": "h263", "size": (176, 144)}, ENCODED),
        ("wmv", {"codec": "wmv2"}, ENCODED),
        ("mp4", {"codec": "mpeg2video", "options": {"g": "8", "bf": "2"}}, ENCODED),
    ],
)
def test_clips_play_in_browsers_copied_where_that_works_and_encoded_elsewhere(
    tmp_path: Path, suffix: str, options: dict[str, Any], expected: tuple[range, range]
) -> None:
    video = write_clip(tmp_path / f"in.{suffix}", count=COUNT, **options)
    (tmp_path / "clips").mkdir()
    found = cut(video, tmp_path / "clips")
    assert found == {
        "clip-00-00-00-car-1+1.mp4": list(expected[0]),
        "clip-00-00-02-fire-truck-3.mp4": list(expected[1]),
    }
    for clip in (tmp_path / "clips").iterdir():
        with closing(Demuxer(clip)) as demuxer:
            assert demuxer.plays


@pytest.mark.parametrize("exact", [False, True])
def test_overwriting_removes_earlier_clips_of_vdet_and_nothing_else(
    source: Path, tmp_path: Path, exact: bool
) -> None:
    theirs = ["clip-2024-birthday-3.mp4", "clip-00-00-07-car-9.mp4"]
    for name in theirs:
        write_clip(tmp_path / name, count=2)
    (tmp_path / "clip-5-folder-9.mkv").mkdir()
    (tmp_path / "clip-00-00-08-car-9.mkv").mkdir()
    before = names(tmp_path)
    cut(source, tmp_path, exact=exact)
    assert len(names(tmp_path)) == len(before) + 2
    cut(source, tmp_path, shown=[])
    assert names(tmp_path) == before


@pytest.mark.parametrize("exact", [False, True])
def test_a_full_disk_ends_the_run_and_names_the_clip(
    source: Path, tmp_path: Path, exact: bool
) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    words = rf"^{tmp_path}(/clip-00-00-00-car-1\+1.mp4)?: cannot be written: File too large$"
    try:
        with pytest.raises(OutputError, match=words):
            cut(source, tmp_path, exact=exact)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert names(tmp_path) == []


@pytest.mark.parametrize("is_link", [False, True])
def test_a_file_of_another_program_with_the_name_of_a_clip_is_kept(
    source: Path, tmp_path: Path, is_link: bool
) -> None:
    cut(source, tmp_path)
    theirs = tmp_path / names(tmp_path)[0]
    if is_link:
        theirs.rename(tmp_path / "ours.mp4")
        theirs.symlink_to("ours.mp4")
    else:
        write_clip(theirs, count=2)
    before, content = names(tmp_path), theirs.read_bytes()
    words = f"{theirs.name}: was not written by vdet and will not be replaced"
    with pytest.raises(OutputError, match=re.escape(words)):
        check_sinks([Output("clips", tmp_path)], OutputFiles(overwrite=True))
    assert (names(tmp_path), theirs.is_symlink()) == (before, is_link)
    assert theirs.read_bytes() == content


def test_no_clip_is_cut_out_of_another_file_of_the_same_name(
    source: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    video, folder = tmp_path / "in.mp4", tmp_path / "clips"
    copy(source, video)

    def shown() -> Iterator[FrameResult]:
        yield from results()
        write_clip(tmp_path / "new.mp4", count=COUNT).replace(video)  # as a ring buffer does

    assert cut(video, folder, shown=shown()) == {}
    assert "in.mp4: changed during the run, so no clips were cut out of it" in caplog.text


def test_no_clip_can_be_cut_out_of_a_pipe(source: Path, tmp_path: Path) -> None:
    with VideoReader(source) as reader:
        video = replace(reader.info, path=tmp_path / "pipe")
    os.mkfifo(video.path)
    with pytest.raises(OutputError, match=r"pipe: can be read only once, so no clips can be cut"):
        write(Output("clips", tmp_path / "clips"), results(), settings=SETTINGS, video=video)

"""Videos from end to end: what is found, what is kept, and what is left when something breaks."""

import gc
import json
import threading
import weakref
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import count, islice, pairwise
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from vdet.pipeline.following import HORIZON_FRAMES, follow, seek_horizon

from conftest import Run
from quick import QUICK, QUICK_OPTIONS
from red_cars import (
    HEIGHT,
    PERSPECTIVE,
    SETTINGS,
    WIDTH,
    by_perspective,
    car_at,
    drive,
    red_finder,
    road,
)
from vdet.config.loading import load_settings
from vdet.config.schema import OutputSettings, Settings, WindowSettings
from vdet.detect.svm.model import load_model
from vdet.errors import ImageError, OutputError, VdetError, VideoError
from vdet.media import Frame, VideoInfo, VideoReader, VideoWriter
from vdet.media.images import Image
from vdet.media.pixels import to_bgr
from vdet.pipeline.loop import Summary, VideoJob, run_video
from vdet.synthetic import frames, true_boxes
from vdet.synthetic.scene import Scene
from vdet.track.rules.tracker import Cars

COUNT = 60
TONE_RATE = 48_000
QUEUED = 24
"""More frames than these held at a time would not be a stream."""


@pytest.fixture(scope="module")
def red_clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A video of the red car that drives from left to right."""
    path = tmp_path_factory.mktemp("red") / "red.mp4"
    info = VideoInfo(path, WIDTH, HEIGHT, Fraction(25), Fraction(1, 25), frames=COUNT)
    with VideoWriter(path, info, OutputSettings(crf=10)) as writer:
        for frame in drive(COUNT):
            writer.write(frame)
    return path


def run_red(job: VideoJob, settings: Settings = SETTINGS) -> Summary:
    return run_video(job, red_finder(), settings)


def read(path: Path) -> list[Frame]:
    with VideoReader(path) as reader:
        return list(reader)


def since_first(path: Path) -> list[Fraction]:
    times = [frame.time for frame in read(path)]
    return [time - times[0] for time in times]


class TestFollow:
    def test_finds_the_vehicle_of_a_drawn_scene(self, scene: Scene, model_path: Path) -> None:
        settings = load_settings(None, QUICK)
        drawn = islice(frames(scene), 16)
        results = list(follow(drawn, load_model(model_path), settings, 320, 180))
        assert [result.frame.index for result in results] == list(range(16))
        nearest = 3  # its number in the scene
        overlaps = []
        for result in results[8:]:
            (box,) = (v.box for v in true_boxes(scene, result.frame.index) if v.id == nearest)
            overlaps.append(max((track.box.iou(box) for track in result.tracks), default=0))
        assert min(overlaps) > 0.3
        assert np.mean(overlaps) > 0.5

    @pytest.mark.parametrize(
        ("settings", "least"), [(SETTINGS, 0.3), (PERSPECTIVE, 0.5)], ids=["original", "default"]
    )
    def test_follows_a_car_by_one_id(self, settings: Settings, least: float) -> None:
        results = list(follow(drive(20), red_finder(), settings, WIDTH, HEIGHT))
        shown = [result for result in results if result.tracks]
        assert len(shown) > 15
        for result in shown:
            (track,) = result.tracks
            assert track.id == 1
            assert track.box.iou(car_at(result.frame.index)) > least

    def test_searches_each_frame_at_the_sets_whose_turn_it_is(self) -> None:
        for result in follow(drive(5), red_finder(), PERSPECTIVE, WIDTH, HEIGHT, threads=2):
            sizes = set(result.detection.windows.boxes[:, 2].tolist())
            assert sizes == ({64} if result.frame.index % 2 else {48})

    @pytest.mark.parametrize("settings", [SETTINGS, PERSPECTIVE], ids=["original", "default"])
    def test_gives_the_same_whatever_the_number_of_threads(self, settings: Settings) -> None:
        one, many = (
            list(follow(drive(20), red_finder(), settings, WIDTH, HEIGHT, threads=threads))
            for threads in (1, 5)
        )
        assert [result.tracks for result in many] == [result.tracks for result in one]
        assert [result.frame.index for result in many] == list(range(20))
        for first, second in zip(one, many, strict=True):
            np.testing.assert_array_equal(first.detection.heat.values, second.detection.heat.values)

    def test_shows_nothing_on_an_empty_road(self) -> None:
        empty = (replace(frame, image=road()) for frame in drive(15))
        for result in follow(empty, red_finder(), SETTINGS, WIDTH, HEIGHT):
            assert result.tracks == ()
            assert result.detection.regions == ()

    def test_gives_every_frame_untouched(self) -> None:
        for result in follow(drive(15), red_finder(), SETTINGS, WIDTH, HEIGHT):
            np.testing.assert_array_equal(result.frame.image, road(car_at(result.frame.index)))

    def test_ids_begin_at_1_in_every_video(self) -> None:
        for _ in range(2):
            *_, last = follow(drive(15), red_finder(), SETTINGS, WIDTH, HEIGHT)
            assert [track.id for track in last.tracks] == [1]

    def test_no_frames_give_no_results(self) -> None:
        assert list(follow([], red_finder(), SETTINGS, WIDTH, HEIGHT)) == []

    def test_a_frame_too_small_for_any_window_is_refused(self) -> None:
        with pytest.raises(ImageError, match="no search window fits into a frame of 20×240"):
            list(follow(drive(3), red_finder(), SETTINGS, 20, HEIGHT))


class TestHorizon:
    """Where it is not set, the first frames tell; and they are searched like all others."""

    FREE = by_perspective(0)

    @pytest.fixture
    def asked(self, monkeypatch: pytest.MonkeyPatch) -> list[list[Image]]:
        """The pictures in which it is looked for; it is always found at 0.35."""
        asked: list[list[Image]] = []

        def find(images: Sequence[Image]) -> float:
            asked.append(list(images))
            return 0.35

        monkeypatch.setattr("vdet.detect.svm.detector.find_horizon", find)
        return asked

    def test_is_looked_for_in_the_first_frames_once(self, asked: list[list[Image]]) -> None:
        list(follow(drive(12), red_finder(), self.FREE, WIDTH, HEIGHT))
        ((*images,),) = asked
        assert len(images) == HORIZON_FRAMES == 5
        for index, image in enumerate(images):
            np.testing.assert_array_equal(image, road(car_at(index)))

    def test_that_is_set_is_not_looked_for(self, asked: list[list[Image]]) -> None:
        list(follow(drive(6), red_finder(), PERSPECTIVE, WIDTH, HEIGHT))
        assert asked == []

    def test_that_is_found_is_as_good_as_one_that_is_set(self, asked: list[list[Image]]) -> None:
        found, given = (
            [(each.frame.index, each.tracks) for each in follow(drive(12), *rest, WIDTH, HEIGHT)]
            for rest in ((red_finder(), self.FREE), (red_finder(), PERSPECTIVE))
        )
        assert found == given
        assert [index for index, _ in found] == list(range(12))
        assert asked

    @pytest.mark.parametrize("count", [0, 1, 4])
    def test_a_clip_may_be_shorter(self, asked: list[list[Image]], count: int) -> None:
        results = list(follow(drive(count), red_finder(), self.FREE, WIDTH, HEIGHT))
        assert [result.frame.index for result in results] == list(range(count))
        assert [len(images) for images in asked] == [count]

    def test_no_more_frames_are_read_than_it_needs(self, asked: list[list[Image]]) -> None:
        frames = drive(12)
        same, horizon = seek_horizon(frames, self.FREE)
        assert horizon == 0.35
        assert next(frames).index == HORIZON_FRAMES
        assert [frame.index for frame in same] == [0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11]
        assert len(asked) == 1


class TestMemory:
    def test_following_holds_few_frames_at_a_time(self) -> None:
        alive: list[weakref.ref[object]] = []

        def watched() -> Iterator[Frame]:
            for frame in drive(COUNT):
                alive.append(weakref.ref(frame.image))
                yield frame

        most = 0
        for _ in follow(watched(), red_finder(), SETTINGS, WIDTH, HEIGHT):
            most = max(most, sum(image() is not None for image in alive))
        assert len(alive) == COUNT
        assert 0 < most <= QUEUED

    def test_a_whole_run_holds_few_frames_at_a_time(self, red_clip: Path, tmp_path: Path) -> None:
        calls = count()
        held: list[int] = []

        def advance(_: int) -> None:
            if next(calls) % 6 == 5:  # looking takes a while
                held.append(sum(isinstance(item, Frame) for item in gc.get_objects()))

        job = VideoJob(red_clip, tmp_path / "out.mp4", tmp_path / "out.csv")
        run_video(job, red_finder(), SETTINGS, threads=2, progress=lambda _: advance)
        assert held
        assert 0 < max(held) <= QUEUED


class TestOutputs:
    def test_the_summary_counts_frames_and_vehicles(self, red_clip: Path, tmp_path: Path) -> None:
        summary = run_red(VideoJob(red_clip, tmp_path / "out.mp4", frames=20))
        assert (summary.frames, summary.tracks) == (20, 1)
        assert summary.seconds > 0

    def test_progress_is_told_of_every_frame(self, red_clip: Path) -> None:
        told: list[int | None] = []

        def progress(total: int | None) -> Callable[[int], object]:
            told.append(total)
            return told.append

        run_video(VideoJob(red_clip, frames=20), red_finder(), SETTINGS, progress=progress)
        assert told[0] == 20
        assert sum(advance or 0 for advance in told[1:]) == 20

    def test_boxes_are_drawn_where_the_tracks_say(self, red_clip: Path, tmp_path: Path) -> None:
        job = VideoJob(red_clip, tmp_path / "out.mp4", tmp_path / "out.jsonl", frames=20)
        run_red(job, SETTINGS.model_copy(update={"output": OutputSettings(crf=1)}))
        records = [json.loads(line) for line in (tmp_path / "out.jsonl").read_text().splitlines()]
        before, after = read(red_clip)[:20], read(tmp_path / "out.mp4")
        for old, new, record in zip(before, after, records, strict=True):
            change = np.abs(new.image.astype(int) - old.image).max(axis=2) > 20
            if not record["tracks"]:
                assert not change.any()
                continue
            (box,) = record["tracks"]
            right, bottom = box["x"] + box["width"], box["y"] + box["height"]
            assert change[bottom - 1, box["x"] : right].mean() > 0.9
            assert change[box["y"] : bottom, right - 1].mean() > 0.9
            assert not change[bottom + 3 :].any()
            assert not change[:, right + 3 :].any()
        assert records[-1]["tracks"]

    def test_the_tracks_do_not_depend_on_whether_a_video_is_written(
        self, red_clip: Path, tmp_path: Path
    ) -> None:
        run_red(VideoJob(red_clip, tmp_path / "out.mp4", tmp_path / "a.csv", frames=20))
        run_red(VideoJob(red_clip, None, tmp_path / "b.csv", frames=20))
        assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
        assert len((tmp_path / "a.csv").read_text().splitlines()) > 10

    def test_a_run_leaves_no_thread_behind(self, red_clip: Path, tmp_path: Path) -> None:
        before = threading.active_count()
        run_red(VideoJob(red_clip, tmp_path / "out.mp4", frames=10))
        assert threading.active_count() == before


def _breaking(method: Callable[..., object], error: BaseException) -> Callable[..., object]:
    """Give a method that works ten times and then breaks."""
    calls = iter(range(10))

    def call(*arguments: object) -> object:
        if next(calls, None) is None:
            raise error
        return method(*arguments)

    return call


class TestBreakage:
    @pytest.fixture
    def job(self, red_clip: Path, tmp_path: Path) -> Iterator[VideoJob]:
        """A job of which, after the test, nothing may be left: neither files nor threads."""
        threads = threading.active_count()
        yield VideoJob(red_clip, tmp_path / "out.mp4", tmp_path / "out.csv")
        assert list(tmp_path.iterdir()) == []
        assert threading.active_count() == threads

    def test_the_tracker_breaks(self, job: VideoJob, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(Cars, "update", _breaking(Cars.update, RuntimeError("broken")))
        with pytest.raises(RuntimeError, match="broken"):
            run_red(job)

    @pytest.mark.parametrize("error", [OutputError("disk full"), OSError(28, "disk full")])
    def test_the_writer_breaks(
        self, job: VideoJob, monkeypatch: pytest.MonkeyPatch, error: OSError
    ) -> None:
        monkeypatch.setattr(VideoWriter, "write", _breaking(VideoWriter.write, error))
        with pytest.raises(OutputError, match="disk full"):
            run_red(job)

    def test_the_reader_breaks(self, job: VideoJob, monkeypatch: pytest.MonkeyPatch) -> None:
        error = VideoError("its pixels cannot be converted")
        monkeypatch.setattr("vdet.media.reader.to_bgr", _breaking(to_bgr, error))
        with pytest.raises(VdetError, match="its pixels"):
            run_red(job)

    def test_the_progress_is_interrupted(self, job: VideoJob) -> None:
        def interrupt(_: int) -> None:
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            run_video(job, red_finder(), SETTINGS, progress=lambda _: interrupt)

    def test_the_work_is_interrupted(self, job: VideoJob, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(Cars, "update", _breaking(Cars.update, KeyboardInterrupt()))
        with pytest.raises(KeyboardInterrupt):
            run_red(job)

    def test_the_command_is_interrupted(
        self,
        run: Run,
        clip_path: Path,
        model_path: Path,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.setattr(Cars, "update", _breaking(Cars.update, KeyboardInterrupt()))
        outputs = (tmp_path / "out.mp4", "--tracks", tmp_path / "out.csv")
        result = run("detect-video", clip_path, *outputs, "--model", model_path, *QUICK_OPTIONS)
        assert result.code == 130
        assert "interrupted" in result.err
        assert list(tmp_path.iterdir()) == []

    def test_an_earlier_output_is_kept(
        self, red_clip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        out = tmp_path / "out.mp4"
        out.write_bytes(b"precious")
        monkeypatch.setattr(Cars, "update", _breaking(Cars.update, RuntimeError("broken")))
        with pytest.raises(RuntimeError, match="broken"):
            run_red(VideoJob(red_clip, out))
        assert out.read_bytes() == b"precious"
        assert [path.name for path in tmp_path.iterdir()] == ["out.mp4"]


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
        run_red(VideoJob(source, tmp_path / "out.mp4"))
        before, after = _sound(source), _sound(tmp_path / "out.mp4")
        assert len(before) > 100
        assert [data for _, data in after] == [data for _, data in before]
        assert [t for t, _ in after] == pytest.approx([t for t, _ in before], abs=0.001)

    def test_a_part_has_the_sound_of_that_part(self, red_clip: Path, tmp_path: Path) -> None:
        source = _remuxed(red_clip, tmp_path / "in.mp4", tone=True)
        begin, end = Fraction(10, 25), Fraction(35, 25)
        run_red(VideoJob(source, tmp_path / "out.mp4", start=begin, end=end))
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
        job = VideoJob(source, tmp_path / "out.mp4", tmp_path / "out.jsonl")
        run_red(job)
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
        empty = SETTINGS.model_copy(
            update={"search": SETTINGS.search.model_copy(update={"probability": 1.0})}
        )
        summary = run_red(VideoJob(source, tmp_path / "out.mp4", frames=5), empty)
        assert summary.frames == 5
        with VideoReader(tmp_path / "out.mp4") as reader:
            assert reader.info.rotation == 0
            written = [frame.image for frame in reader]
        turned = np.rot90(road(car_at(2)), rotation // 90)
        assert written[2].shape == turned.shape
        assert np.abs(written[2].astype(int) - turned).mean() < 4

    def test_a_car_in_a_rotated_clip_is_found_upright(self, red_clip: Path, tmp_path: Path) -> None:
        source = _remuxed(red_clip, tmp_path / "in.mp4", rotation=180)
        whole = (WindowSettings(size=32, overlap=0.75, top=0, bottom=HEIGHT),)
        search = SETTINGS.search.model_copy(update={"windows": whole})
        settings = SETTINGS.model_copy(update={"search": search})
        run_red(VideoJob(source, None, tmp_path / "out.jsonl", frames=15), settings)
        last = json.loads((tmp_path / "out.jsonl").read_text().splitlines()[-1])
        (track,) = last["tracks"]
        car = car_at(14)
        middle = WIDTH - car.center[0], HEIGHT - car.center[1]
        assert track["x"] + track["width"] / 2 == pytest.approx(middle[0], abs=10)
        assert track["y"] + track["height"] / 2 == pytest.approx(middle[1], abs=10)

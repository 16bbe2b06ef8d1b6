"""The public API: docs/api.md runs as it stands, and `import vdet` does nothing else."""

import json
import math
import pickle
import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import vdet
from doc_pages import DOCS, blocks
from red_cars import HEIGHT, WIDTH, car_at, drive
from running import frames_of, write_drive
from vdet.boxes import Image
from vdet.detect.onnx.detector import SHIPPED
from vdet.media import Frame, Picture
from vdet.media.reader import VideoReader
from vdet.synthetic import Renderer, Scene
from vdet.traffic.records import records_content
from writing import write_image


@pytest.fixture(scope="module")
def page(
    tmp_path_factory: pytest.TempPathFactory, scene: Scene, clip_path: Path
) -> tuple[Path, dict[str, Any]]:
    """Run the page's code from top to bottom in a folder with a clip and a picture."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "in.mp4").write_bytes(clip_path.read_bytes())
    write_image(folder / "road.png", Renderer(scene).image(10))
    names: dict[str, Any] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for block in blocks("api.md"):
            exec(compile(block, "docs/api.md", "exec"), names)
    return folder, names


def test_the_page_runs_and_leaves_its_files(page: tuple[Path, dict[str, Any]]) -> None:
    folder, names = page
    written = "found.png gate.yaml in.mp4 out.csv out.mp4 part.csv road.png"
    assert sorted(path.name for path in folder.iterdir()) == written.split()
    assert frames_of(folder / "out.mp4") == frames_of(folder / "in.mp4")
    assert isinstance(names["detections"], vdet.Boxes)
    (track,) = names["tracks"]
    assert (track.id, track.state) == (1, "detected")
    assert abs(track.box.x1 - 657) <= 10


def test_the_notebook_runs_and_has_no_outputs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cells = json.loads((DOCS / "notebook.ipynb").read_text("utf-8"))["cells"]
    assert [cell.get("outputs", []) for cell in cells] == [[]] * len(cells)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for number, cell in enumerate(cells, start=1):
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"docs/notebook.ipynb:{number}", "exec"), names)
    assert sum(total.count for total in names["counts"].totals) > 0
    assert len(names["results"].vehicles) > 1


def test_the_public_names_are_listed_and_documented_and_no_others_are_there() -> None:
    assert {*vdet.api.__all__, "__version__"} <= set(dir(vdet))
    for name in vdet.api.__all__:
        assert getattr(vdet, name).__doc__, f"vdet.{name} has no docstring"
    with pytest.raises(AttributeError, match="no attribute 'Dedector'"):
        _ = vdet.Dedector


def test_names_that_went_say_what_to_use() -> None:
    for name, module in vdet._DEPRECATED.items():
        assert name not in vdet.api.__all__
        with pytest.warns(DeprecationWarning, match=rf"use {re.escape(module)}\.{name}$"):
            assert isinstance(getattr(vdet, name), type)


def test_importing_vdet_has_no_side_effect() -> None:
    code = (
        "import os, sys, logging\n"
        "before = dict(os.environ), logging.root.handlers[:]\n"
        "import vdet\n"
        "assert (dict(os.environ), logging.root.handlers) == before\n"
        "assert not {'cv2', 'av', 'numpy'} & set(sys.modules), 'it loads what nobody asked for'\n"
        "vdet.Detector\n"
        "new = set(os.environ) - set(before[0])\n"
        "assert not [name for name in new if not name.startswith('LD_')], new  # OpenCV's own\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((90, 160), np.uint8),
        np.zeros((90, 160, 4), np.uint8),
        np.zeros((90, 160, 3), np.float32),
        np.zeros((0, 160, 3), np.uint8),
    ],
)
def test_what_is_no_bgr_image_is_refused(image: Any) -> None:
    with pytest.raises(ValueError, match=r"^image: must be .* BGR uint8 \(H, W, 3\), not \w+ \("):
        vdet.Detector().detect(image)


def test_a_detector_takes_an_array_or_the_path_of_a_picture(tmp_path: Path) -> None:
    (frame,) = drive(1)
    write_image(tmp_path / "red.png", frame.image)
    detector = vdet.Detector(detector=red_boxes)
    expected = list(detector.detect(frame.image))
    assert expected
    assert list(detector.detect(tmp_path / "red.png")) == expected
    assert list(detector.detect(str(tmp_path / "red.png"))) == expected
    assert len(vdet.detect_image(tmp_path / "red.png", detector=red_boxes)) == 1
    with pytest.raises(vdet.VdetError, match=r"none\.png"):
        detector.detect(tmp_path / "none.png")
    wrong: Any = [frame.image]
    with pytest.raises(TypeError, match=r"^image: must be a path or an array.*, not a list$"):
        detector.detect(wrong)


def test_only_the_classes_of_the_settings_are_detected_in_images(tmp_path: Path) -> None:
    def find(_: Image) -> vdet.Boxes:
        sides = [(0, 0, 9, 9), (20, 0, 29, 9)]
        return vdet.Boxes(sides, [0.9, 0.8], classes=[0, 1], names=("car", "truck"))

    write_image(tmp_path / "in.png", np.zeros((64, 64, 3), np.uint8))
    settings = vdet.load_settings(assignments=["classes=[truck]"])
    detector = vdet.Detector(settings, detector=find)
    for found in (
        detector.detect(tmp_path / "in.png"),
        vdet.detect_image(tmp_path / "in.png", settings=settings, detector=find),
    ):
        assert [(item.class_name, item.box.x1) for item in found] == [("truck", 20)]


@pytest.mark.parametrize(("assignments", "step"), [([], 1), (["detector.stride=3"], 3)])
def test_a_detector_object_is_not_taken_for_that_of_the_settings(
    red_clip: Path, tmp_path: Path, assignments: list[str], step: int
) -> None:
    settings = vdet.load_settings(assignments=["classes=[]", *assignments])
    found = vdet.follow(red_clip, settings=settings, detector=red_boxes, frames=7)
    assert [result.searched for result in found] == [n % step == 0 for n in range(7)]
    run = vdet.Run(red_clip, settings=settings, frames=7)
    vdet.detect_video(run, tracks=tmp_path / "t.jsonl", detector=red_boxes)
    head = json.loads((tmp_path / "t.jsonl").read_text().splitlines()[0])
    assert head["video"]["settings"]["detector"]["kind"] == "object"


def test_a_notebook_shows_a_result_as_its_frame_with_the_vehicles() -> None:
    (frame,) = drive(1)
    box = vdet.Box(96, 120, 160, 168)
    result = vdet.FrameResult(Path("a.mp4"), frame, vdet.Boxes([], []), (), searched=False)
    shown = replace(result, tracks=(vdet.Track(1, box, 0.9, "detected", "car"),))
    plain, drawn = (
        np.asarray(cv2.imdecode(np.frombuffer(item._repr_png_(), np.uint8), cv2.IMREAD_COLOR))
        for item in (result, shown)
    )
    assert np.array_equal(plain, frame.image)
    assert np.any(drawn != plain, axis=2)[120, 96:160].all()


@pytest.mark.parametrize("number", [{"frames": -1}, {"threads": 0}])
def test_numbers_below_one_are_refused_by_name(clip_path: Path, number: dict[str, Any]) -> None:
    (name,) = number
    with pytest.raises(vdet.VdetError, match=f"^{name}: is -?[01]; must be at least 1"):
        vdet.Run(clip_path, **number)


@pytest.mark.parametrize("end", [math.inf, math.nan, -1.0])
def test_a_time_outside_any_video_is_rejected(clip_path: Path, end: float) -> None:
    with pytest.raises(vdet.VdetError, match=r"^start and end: must be seconds from 0, not "):
        vdet.follow(clip_path, end=end)


@pytest.mark.parametrize("interval", [0, -5])
def test_an_interval_has_at_least_a_second(interval: int) -> None:
    counts = vdet.Counts(events=(), directions=(), zones=())
    for table in (counts.table, counts.flows, counts.zone_use):
        with pytest.raises(vdet.VdetError, match=r"^interval: must be at least 1 second, not "):
            table(interval)


def test_results_that_are_left_open_at_exit_leave_no_traceback(clip_path: Path) -> None:
    code = f"import gc, vdet; gc.disable(); r = vdet.follow({str(clip_path)!r}); next(r)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_run_has_its_own_part_and_settings(clip_path: Path) -> None:
    run = vdet.Run(clip_path, frames=3)
    assert len(list(vdet.follow(run))) == 3
    with pytest.raises(ValueError, match="frames: a Run has its own"):
        next(vdet.follow(run, frames=2))
    with pytest.raises(ValueError, match="settings: a Run has its own"):
        vdet.detect_video(run, settings=vdet.load_settings())
    wrong: Any = {"fames": 2}
    with pytest.raises(TypeError, match=r"^fames: unknown option; known: settings, detector, "):
        vdet.follow(clip_path, **wrong)


def test_a_run_is_a_value() -> None:
    paths: tuple[Any, ...] = Path("a.mp4"), "a.mp4"
    one, other = (vdet.Run(path, settings=vdet.load_settings()) for path in paths)
    assert one == other
    assert len({one, other, pickle.loads(pickle.dumps(one))}) == 1


def test_messages_name_parameters(clip_path: Path, tmp_path: Path) -> None:
    (taken := tmp_path / "a.csv").touch()
    with pytest.raises(vdet.VdetError, match=r"already exists; use overwrite=True to replace it"):
        vdet.detect_video(clip_path, tracks=taken, detector=red_boxes)
    with pytest.raises(vdet.VdetError, match=r"^assignments: output.crf: must be less than"):
        vdet.load_settings(assignments=["output.crf=99"])
    line = "traffic.lines=[{name: a, start: [0, 0], end: [1, 1]}]"
    settings = vdet.load_settings(assignments=[line])
    with pytest.raises(vdet.VdetError, match=r"as in size=\(1280, 720\)"):
        vdet.count([vdet.FrameTracks(0, 0.0, ())], settings)


def test_a_tracker_knows_its_vehicles_in_frames_in_which_nobody_looked() -> None:
    tracker = vdet.Tracker(1280, 720)
    found = vdet.Boxes([[600, 400, 700, 480]], [0.9])
    for number in range(40):
        looks = number % 4 == 0
        tracks = tracker.update(found, number / 25) if looks else tracker.at(number / 25)
    assert [(track.id, track.state) for track in tracks] == [(1, "interpolated")]


def test_the_tracker_that_looks_at_pixels_asks_for_them() -> None:
    settings = vdet.load_settings((), ["tracker.kind=rules"])
    tracker = vdet.Tracker(320, 240, settings)
    found = vdet.Boxes([[96, 120, 160, 168]], [0.9])
    with pytest.raises(ValueError, match="image"):
        tracker.update(found, 0.0)
    (frame,) = drive(1)
    assert tracker.update(found, 0.0, frame.image) == []


class Red:
    """A detector of the user's own: red things."""

    def search(self, picture: Picture, index: int | None) -> vdet.Boxes:  # noqa: ARG002
        return red_boxes(picture.image)

    def detect(self, candidates: vdet.Boxes) -> vdet.Boxes:
        return candidates


def red_boxes(image: Image) -> vdet.Boxes:
    x, y, width, height = cv2.boundingRect(
        (image[..., 2].astype(int) - image[..., 0] > 80).astype(np.uint8)
    )
    return vdet.Boxes([(x, y, x + width, y + height)][: width > 0], [0.9][: width > 0])


class Latest:
    """A tracker of the user's own: the latest detections."""

    def update(
        self, detections: vdet.Boxes, _: float, __: Picture | None = None
    ) -> list[vdet.Track]:
        return [
            vdet.Track(number, detection.box, 0.9, state="detected")
            for number, detection in enumerate(detections, start=1)
        ]


class Even:
    """A step of the user's own: vehicles are shown in every other frame."""

    def apply(self, result: vdet.FrameResult) -> vdet.FrameResult:
        return result if result.frame.index % 2 == 0 else replace(result, tracks=())


@pytest.fixture(scope="module")
def red_clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_drive(tmp_path_factory.mktemp("red") / "red.mp4", 60)


@pytest.mark.parametrize("detector", [Red(), red_boxes, vdet.Detector(detector=red_boxes)])
@pytest.mark.parametrize("tracker", [Latest, partial(vdet.Tracker, WIDTH, HEIGHT), "motion", None])
def test_follow_takes_objects_and_names(red_clip: Path, detector: Any, tracker: Any) -> None:
    tracker = tracker() if callable(tracker) else tracker
    results = list(vdet.follow(red_clip, detector=detector, tracker=tracker))
    assert all(result.searched for result in results)
    (track,) = results[-1].tracks
    assert abs(track.box.x1 - car_at(59).x1) <= 3


def test_detect_video_takes_what_the_command_takes(red_clip: Path, tmp_path: Path) -> None:
    seen: list[tuple[int, int | None]] = []
    changes = ["lanes.enabled=true", "input.begin='2026-05-01 07:00+02:00'"]
    settings = vdet.load_settings(assignments=changes)
    begin, end, at = Fraction("0.08"), Fraction("0.4"), Fraction("0.2")
    run = vdet.Run(red_clip, settings=settings, start=begin, end=end, frames=6, at=at)
    totals = vdet.detect_video(
        run,
        tracks=[tmp_path / "a.csv", tmp_path / "a.jsonl"],
        outputs={"stages": tmp_path / "stages"},
        detector=red_boxes,
        tracker=Latest(),
        steps=[Even()],
        progress=lambda done, total: seen.append((done, total)),
    )
    assert (totals.frames, totals.tracks) == (6, 1)
    assert str(totals.clock) == "2026-05-01 07:00:00+02:00 (as given)"
    assert seen == [(number, 6) for number in range(1, 7)]
    records = [json.loads(line) for line in (tmp_path / "a.jsonl").read_text().splitlines()]
    assert [len(record["tracks"]) for record in records] == [1, 0] * 3
    assert "lane" in records[0]
    assert (tmp_path / "stages" / "1-boxes.png").exists()
    assert (tmp_path / "a.csv").exists()


def test_a_model_file_decides_the_kind_of_its_detector(tmp_path: Path) -> None:
    for name in ("svm.npz", "net.onnx"):
        shutil.copy(SHIPPED.with_name(name), tmp_path / name)
        detector = vdet.Detector(detector=tmp_path / name)
        assert len(detector.detect(np.zeros((96, 160, 3), np.uint8))) == 0
    with pytest.raises(vdet.VdetError, match=r"none\.npz: cannot be read"):
        vdet.Detector(detector="none.npz")


def test_follow_and_files_have_the_same_counts_vehicles_and_findings(
    red_clip: Path, tmp_path: Path
) -> None:
    lines = tmp_path / "lines.yaml"
    lines.write_text(
        f"camera: {{size: [{WIDTH}, {HEIGHT}]}}\ntraffic:\n  min_seen_seconds: 0\n  lines:\n"
        "  - {name: gate, start: [100, 0], end: [100, 240]}\n"
    )
    settings = vdet.load_settings([lines], ["detector.stride=1", "lanes.enabled=true"])
    given: dict[str, Any] = {"detector": red_boxes, "tracker": Latest(), "settings": settings}
    results = vdet.follow(red_clip, **given)
    assert (results.counts, results.vehicles, results.findings) == (None, (), ())
    frames = list(results)
    tracks = tmp_path / "t.jsonl"
    outputs = {name: tmp_path / f"{name}.json" for name in ("counts", "vehicles", "conditions")}
    vdet.detect_video(red_clip, tracks=tracks, outputs=outputs, **given)
    from_file = vdet.count(tracks, settings)
    assert sum(total.count for total in from_file.totals) == 1
    assert from_file == results.counts
    assert replace(from_file, findings=()) == vdet.count(frames, settings)
    in_files = {name: json.loads(path.read_text()) for name, path in outputs.items()}
    totals = [total.count for total in from_file.totals]
    assert [item["count"] for item in in_files["counts"]["totals"]] == totals
    assert records_content(results.vehicles, outputs["vehicles"]) == in_files["vehicles"]
    assert results.findings
    assert [finding.record() for finding in results.findings] == in_files["conditions"]
    assert vdet.vehicles(red_clip, **given) == results.vehicles


def test_follow_leaves_the_threads_of_opencv_as_they_are(clip_path: Path) -> None:
    before = cv2.getNumThreads()
    cv2.setNumThreads(2)
    try:
        assert {cv2.getNumThreads() for _ in vdet.follow(clip_path, frames=3)} == {2}
    finally:
        cv2.setNumThreads(before)


def test_follow_may_be_left_while_a_frame_is_read(
    clip_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reads, goes_on, closed = threading.Event(), threading.Event(), threading.Event()
    deliver, leave = VideoReader.__iter__, VideoReader.__exit__

    def slow(self: VideoReader) -> Iterator[Frame]:
        for number, frame in enumerate(deliver(self)):
            yield frame
            if number == 1:
                reads.set()
                goes_on.wait(10)

    def noted(self: VideoReader, *raised: object) -> None:
        leave(self, *raised)
        closed.set()

    monkeypatch.setattr(VideoReader, "__iter__", slow)
    monkeypatch.setattr(VideoReader, "__exit__", noted)
    monkeypatch.setattr("vdet.workers.JOIN_TIMEOUT", 0.1)
    at_once = vdet.load_settings(assignments=["detector.stride=1", "tracker.look_ahead=0"])
    results = vdet.follow(clip_path, settings=at_once)
    next(results)
    assert reads.wait(10)
    results.close()
    goes_on.set()
    assert closed.wait(10), "the file stays open"


@pytest.mark.parametrize("time", [0.5, 0.4, float("nan"), float("inf")])
def test_a_tracker_refuses_times_that_do_not_increase(time: float) -> None:
    tracker = vdet.Tracker(640, 360)
    tracker.update(vdet.Boxes([], []), 0.5)
    with pytest.raises(ValueError, match=r"^time: .* s; must be after the previous frame, 0\.5 s$"):
        tracker.update(vdet.Boxes([], []), time)
